// The tip, dragged: the arm follows as its joints can, and lags where they cannot.

class Drag {
  // `app` leads the arm (`led(q, goal, hold)`) and says what it holds (`hold(q)`).
  constructor(app) {
    this.app = app;
    this.grip = $("grip");
    this.line = $("lag").firstElementChild;
    this.goal = null;
    this.grip.addEventListener("pointerdown", (event) => this.begin(event));
    this.grip.addEventListener("pointermove", (event) => { if (this.goal) this.goal = this.under(event); });
    for (const end of ["pointerup", "pointercancel"]) this.grip.addEventListener(end, () => this.end());
    app.view.placed = (camera) => this.place(camera);
  }

  begin(event) {
    const { app } = this, { frame, viewer } = app.view;
    event.preventDefault();
    this.grip.setPointerCapture(event.pointerId);
    ++app.turn;
    app.select(null, 0);
    app.view.touched = true; // the picture stays as it is while it is held
    this.q = frame.q;
    this.hold = app.hold(frame.q);
    const [x, y, depth] = this.pixels(frame.tip, viewer.camera);
    Object.assign(this, { off: [event.clientX - x, event.clientY - y], depth });
    this.goal = frame.tip;
    this.step();
  }

  pixels(point, camera) {
    const { element } = this.app.view, box = element.getBoundingClientRect(), [x, y, depth] = pixelsOf(yUp(point), camera, element);
    return [box.left + x, box.top + y, depth];
  }

  // In the plane through the tip that faces the camera.
  under(event) {
    const { element, viewer } = this.app.view, box = element.getBoundingClientRect();
    const across = (event.clientX - this.off[0] - box.left) / box.width, down = (event.clientY - this.off[1] - box.top) / box.height;
    const { x, y, z } = new MeshCat.THREE.Vector3(2 * across - 1, 1 - 2 * down, this.depth).unproject(viewer.camera);
    return [x, -z, y];
  }

  // As long as it is held: towards the pointer, once a picture.
  step() {
    if (!this.goal) return;
    const { app } = this, { frame, words } = app.led(this.q, this.goal, this.hold);
    if (frame.q.some((v, j) => Math.abs(v - this.q[j]) > 1e-9)) {
      this.q = frame.q;
      app.view.pace.moved();
      app.frame(frame);
    }
    app.say(words);
    app.view.viewer.set_dirty();
    requestAnimationFrame(() => this.step());
  }

  end() {
    this.goal = null;
    this.app.view.viewer.set_dirty();
  }

  place(camera) {
    const { view } = this.app, stage = $("stage").getBoundingClientRect(), [x, y, depth] = this.pixels(view.frame.tip, camera);
    this.grip.hidden = depth > 1;
    Object.assign(this.grip.style, { left: `${x - stage.left}px`, top: `${y - stage.top}px` });
    const [gx, gy] = this.goal ? this.pixels(this.goal, camera) : [x, y];
    for (const [name, v] of Object.entries({ x1: x - stage.left, y1: y - stage.top, x2: gx - stage.left, y2: gy - stage.top })) this.line.setAttribute(name, v);
  }
}
