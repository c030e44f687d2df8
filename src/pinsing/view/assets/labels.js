// Labels of what is drawn, as text over the view: inside it, beside the legend and beside each other.

const GAP = 8; // px between a point and its label

// A point of the base, z up, in the axes of three.js.
const yUp = ([x, y, z]) => new MeshCat.THREE.Vector3(x, z, -y);

// Where a point in these axes is in the picture of an element, pixels, and how deep: beyond 1 it is not seen.
function pixelsOf(point, camera, { clientWidth, clientHeight }) {
  const { x, y, z } = point.clone().project(camera);
  return [((x + 1) / 2) * clientWidth, ((1 - y) / 2) * clientHeight, z];
}

// Where another element is in it, pixels.
function boxIn(element, node) {
  const { left, top } = element.getBoundingClientRect(), box = node.getBoundingClientRect();
  return new DOMRect(box.left - left, box.top - top, box.width, box.height);
}

class Labels {
  constructor(element) {
    this.element = element;
    this.nodes = [$("label-lost")];
    this.marks = [];
  }

  // Marks: { at: point of the base, text, free: whether it is something not held }.
  // `tip`, the tool, is not to be covered.
  set(marks, tip) {
    this.marks = marks;
    this.tip = tip;
    while (this.nodes.length < marks.length) {
      const node = make("div", "label");
      this.nodes.at(-1).after(node);
      this.nodes.push(node);
    }
    this.nodes.forEach((node, k) => {
      node.hidden = k >= marks.length;
      if (node.hidden) return;
      node.textContent = marks[k].text;
      node.classList.toggle("free", Boolean(marks[k].free));
    });
  }

  place(camera) {
    const { element } = this, { clientWidth: wide, clientHeight: high } = element, taken = [boxIn(element, $("legend"))];
    const [tx, ty] = this.tip ? pixelsOf(yUp(this.tip), camera, element) : [-1e6, -1e6];
    this.marks.forEach(({ at }, k) => {
      const node = this.nodes[k], [px, py, depth] = pixelsOf(yUp(at), camera, element);
      node.hidden = depth > 1;
      if (node.hidden) return;
      const { offsetWidth: w, offsetHeight: h } = node;
      const inside = (v, size, room) => Math.min(Math.max(v, 4), Math.max(4, room - size - 4));
      // Beside its point on one side or the other, above or below it, then wherever there is room.
      const places = [[px + GAP, py - h / 2], [px - GAP - w, py - h / 2], [px - w / 2, py - h - GAP], [px - w / 2, py + GAP]];
      for (const box of taken) places.push([px + GAP, box.bottom + 4], [box.right + 4, py - h / 2]);
      const costs = places.map(([left, top], n) => {
        const spot = new DOMRect(inside(left, w, wide), inside(top, h, high), w, h), { right, bottom } = spot;
        const over = taken.some((b) => spot.left < b.right && right > b.left && spot.top < b.bottom && bottom > b.top);
        // The tool, the end of the arrow, and its shaft from there.
        const hides = [[px, py], [tx, ty], [0.8 * px + 0.2 * tx, 0.8 * py + 0.2 * ty]].some(([x, y]) => x > spot.left - 4 && x < right + 4 && y > spot.top - 4 && y < bottom + 4);
        return { spot, cost: Math.hypot(spot.left - left, spot.top - top) + 20 * n + (over ? 1e6 : 0) + (hides ? 300 : 0) };
      });
      const { spot } = costs.reduce((a, b) => (b.cost < a.cost ? b : a));
      taken.push(spot);
      node.style.left = `${element.offsetLeft + spot.left}px`;
      node.style.top = `${element.offsetTop + spot.top}px`;
    });
  }

  // Drawn with a pen of the 2D canvas whose origin is that of the view.
  draw(pen) {
    for (const node of this.nodes.filter((n) => !n.hidden)) {
      const { x, y, width, height } = boxIn(this.element, node), look = getComputedStyle(node);
      pen.fillStyle = look.backgroundColor;
      pen.fillRect(x, y, width, height);
      pen.fillStyle = look.color;
      pen.fillText(node.textContent, x + 6, y + height / 2);
    }
  }
}
