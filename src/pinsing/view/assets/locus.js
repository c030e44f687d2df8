// The equation of a family as one for a joint, and its curve over two joints, the others on sliders.

const LOCUS = { wide: 320, high: 210, frame: [[44, 312], [180, 8]] }; // frame: from where to where, across and up

// "R cos(q3 - φ) = 0", what follows, and what R and φ are.
function statement(solved) {
  const box = make("div", "statement");
  for (const one of solved) {
    box.append(formula(make("p"), one.condition), formula(make("p", "note"), one.solution));
    for (const [title, parts] of [["with", one.where], ["with exact coefficients", one.exact]]) {
      if (!parts.length) continue;
      box.append(make("details", "", make("summary", "", title), ...parts.map(([name, text]) => formula(make("p"), `${name} = ${text}`))));
    }
  }
  return box;
}

class Locus {
  // `app` is asked to pick [[joint, value], ...] where the picture is clicked.
  constructor(app, family, q) {
    const { joints } = app;
    Object.assign(this, { app, joints, family });
    const { involved } = Engine.curveBranch(family, q, joints);
    const pair = involved.slice(-2);
    this.menus = pair.map((chosen, k) => make("select", { ariaLabel: k ? "Joint upward" : "Joint across", onchange: () => this.changed(k) },
      ...involved.map((j) => new Option(joints[j].symbol, j, false, j === chosen))));
    this.shown = pair;
    const head = make("p", "note", "Where it holds over ", this.menus[0], " and ", this.menus[1], ", the others on their sliders:");
    this.picture = this.make("svg", { viewBox: `0 0 ${LOCUS.wide} ${LOCUS.high}`, role: "img" });
    this.picture.addEventListener("click", (event) => this.clicked(event));
    this.words = make("p", "note");
    this.node = make("div", "locus", head, this.picture, this.words);
    this.draw(q);
  }

  make(tag, attributes, text) {
    const node = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    if (text !== undefined) node.textContent = text;
    return node;
  }

  // The two joints differ: choosing that of the other menu swaps them.
  changed(k) {
    const next = this.menus.map((m) => Number(m.value));
    if (next[0] === next[1]) this.menus[1 - k].value = String(next[1 - k] = this.shown[k]);
    this.shown = next;
    this.draw(this.q);
  }

  get spans() { return this.shown.map((j) => this.joints[j].span); }

  // Where a value of a joint, k = 0 across and 1 up, is in the picture, and the other way round.
  place(k, v) { const [a, b] = this.spans[k], [from, to] = LOCUS.frame[k]; return from + ((v - a) / (b - a)) * (to - from); }

  value(k, x) { const [a, b] = this.spans[k], [from, to] = LOCUS.frame[k]; return Math.min(b, Math.max(a, a + ((x - from) / (to - from)) * (b - a))); }

  draw(q) {
    this.q = q;
    const { joints } = this, [i, j] = this.shown, spans = this.spans;
    const branch = Engine.curveBranch(this.family, q, joints), held = q.slice();
    for (const v of branch.values) held[v.joint] = v.value;
    const lines = Engine.locus(branch.equation, held, i, j, ...spans);
    const text = (k, v) => Engine.valueText(joints[k].prismatic, v, 0);
    const [[left, right], [low, high]] = LOCUS.frame;
    const path = lines.map((line) => line.map((p, k) => (k ? "L" : "M") + p.map((v, n) => this.place(n, v).toFixed(1)).join(" ")).join("")).join("");
    const label = (k, v, x, y, anchor) => this.make("text", { x, y, "text-anchor": anchor }, v === null ? joints[k].symbol : text(k, v));
    this.picture.replaceChildren(
      this.make("rect", { x: left, y: high, width: right - left, height: low - high }),
      this.make("path", { d: path }),
      this.make("circle", { cx: this.place(0, q[i]), cy: this.place(1, q[j]), r: 4.5 }),
      label(i, spans[0][0], left, low + 14, "start"), label(i, spans[0][1], right, low + 14, "end"),
      label(i, null, (left + right) / 2, low + 14, "middle"),
      label(j, spans[1][0], left - 4, low, "end"), label(j, spans[1][1], left - 4, high + 8, "end"),
      label(j, null, left - 4, (low + high) / 2, "end"));
    const symbols = [joints[i].symbol, joints[j].symbol].join(" and ");
    const fixed = branch.values.map((v) => `${joints[v.joint].symbol} = ${text(v.joint, v.value)}`).join(", ");
    this.words.textContent = `${lines.length ? "" : "It holds nowhere here: move the other sliders. "}` +
      `${fixed ? `The curve is for ${fixed}. ` : ""}Dot: this pose. A click moves ${symbols} there.`;
    this.picture.setAttribute("aria-label", `Curve of ${this.family.name} over ${symbols}`);
  }

  clicked(event) {
    const box = this.picture.getBoundingClientRect();
    const at = [((event.clientX - box.left) * LOCUS.wide) / box.width, ((event.clientY - box.top) * LOCUS.high) / box.height];
    this.app.pick(this.shown.map((joint, k) => [joint, this.value(k, at[k])]));
  }
}
