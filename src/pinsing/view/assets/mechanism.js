// A mechanism with closed loops: inputs are dragged, the other joints follow; modes are chosen.
"use strict";

const SETTLED = 120; // ms without a move

class MechanismApp extends App {
  constructor(page, view, scene, stream) {
    const { engine } = page;
    engine.homePose = Engine.poseOf(engine, Engine.placeOf(engine, engine.home));
    super(page, view, scene, stream);
    document.body.classList.add("mechanism");
    // In a plane, what is drawn at the output lies inside the links.
    if (page.settings.planar) for (const part of ["ellipsoid", "lost", "free"]) {
      this.view.node(part).traverse((o) => {
        if (!o.material) return;
        o.material.depthTest = false;
        o.renderOrder = part === "ellipsoid" ? 1 : 2;
      });
    }
  }

  // A dragged output keeps the rest of its pose.
  hold(q) { return Engine.poseOf(this.page.engine, Engine.placeOf(this.page.engine, q)); }

  led(q, goal, hold) {
    const { engine } = this.page, { q: there, stop } = Engine.posed(engine, engine.pose.rows.map((row, k) => (row < 3 ? goal[row] : hold[k])), q);
    return { frame: this.source.compute(there), words: stop ? `the output lags behind: ${Engine.stopWords(engine, stop)}` : "" };
  }

  inputs(q) { return this.page.inputs.map((i) => q[i]); }

  // Once at rest: how far the inputs and the pose go, one after the other, and the other modes.
  async rest(frame) {
    const { inputs, engine } = this.page, found = [], q = frame.q, aside = this.aside ??= new Aside(engine);
    const stale = () => frame !== this.view.frame || this.running || this.wanted !== null;
    aside.stop();
    await new Promise((resolve) => setTimeout(resolve, SETTLED));
    for (const k of inputs.keys()) {
      if (stale()) return;
      found.push(await aside.ask("stretch", q, k));
      if (stale()) return;
      if (found[k]) this.panel.stretch(frame, inputs[k], found[k]);
    }
    const modes = await aside.ask("modesAt", q);
    if (stale()) return;
    this.panel.menu(modes.assemblies, modes.working);
    this.stretches = found;
    if (frame.status !== "singular") {
      const none = found.every((one) => one && !one.points.length);
      this.panel.ahead(none ? "no input alone leads to a singular pose" : Engine.aheadOf(engine, q, found)?.text);
    }
    for (const k of engine.pose.rows.keys()) {
      const reach = await aside.ask("poseStretch", q, k, this.page.settings.reach);
      if (stale()) return;
      this.panel.stretch(frame, q.length + k, reach);
    }
    this.known = frame;
  }

  // An input moved, or a coordinate of the pose: the output is led.
  move(index, value) {
    const { frame } = this.view, k = index - frame.q.length;
    if (k < 0) { super.move(index, value); return; }
    const goal = this.wanted?.goal?.slice() ?? this.panel.poseValues(frame);
    goal[k] = value;
    this.want({ goal, k, q: this.panel.values(frame), joint: index });
  }

  // A pose out of an address: all joints, whose loops are closed, or the inputs alone.
  framed(q) {
    const { engine, inputs, joints } = this.page;
    if (q.length === joints.length) {
      const { q: closed, error } = Engine.gaussNewton(engine, q, Engine.passiveOf(engine));
      if (error <= 1e-9) return this.source.compute(closed);
      return { ...this.source.compute(engine.home), refused: "refused: with the values in the address the loops do not close; this is home." };
    }
    return q.length === inputs.length ? this.source.driven(engine.home, q) : null;
  }

  misfit(q) {
    const { joints, inputs } = this.page, fits = q.length === joints.length;
    return fits ? "the loops do not close near the joint values of the address"
      : `the address holds ${q.length} value${q.length === 1 ? "" : "s"}; this mechanism has ${joints.length} joints, ${inputs.length} of them inputs`;
  }

  // The way starts where the mechanism is, in the turn that its sliders show.
  moved({ q, goal, k }) {
    return goal ? this.source.posed(q, goal, k) : this.source.driven(this.panel.values(this.view.frame), this.inputs(q));
  }

  async reset() {
    if (this.entry !== null) { this.choose(this.entry, this.pose); return; }
    this.go(this.page.engine.home);
  }

  poseTexts() {
    const { q, pose } = this.view.frame, flag = this.inputs(q), names = this.page.joints.map((j) => j.name);
    const { engine } = this.page, coordinates = pose.map((_, k) => Engine.poseName(engine, k));
    return { flag, link: q, python: `inputs = np.array([${trimmed(flag).join(", ")}])  # ${this.page.robot.inputs.join(", ")}\n` +
               `pose = np.array([${trimmed(pose).join(", ")}])  # ${coordinates.join(", ")}, m and rad\n` +
               `q = np.array([${trimmed(q).join(", ")}])`,
             json: { robot: this.page.robot.name, joints: names, q, inputs: this.page.robot.inputs,
                     pose: Object.fromEntries(coordinates.map((name, k) => [name, pose[k]])) } };
  }

  fileJoints() { return this.page.inputs.map((i) => this.page.engine.joints[i]); }

  // A file holds the inputs: the mechanism follows them from where it is, as far as the mode goes. A row may
  // be many steps from the one before, so a worker takes them.
  async follow(name, all) {
    const count = all.length, step = Math.max(1, Math.ceil(count / 400)), rows = all.filter((_, i) => i % step === 0 || i === count - 1);
    const turn = ++this.turn;
    this.say(`${name}: following the inputs\u2026`);
    const found = await this.source.beside("followInputs", this.view.frame.q, rows);
    if (!found || turn !== this.turn) return;
    const { path, row, said } = found;
    const end = said && `; sample ${Math.round((row * (count - 1)) / Math.max(1, rows.length - 1)) + 1}: ${said}`;
    if (!path.length) { this.say(`${name}${end}`); return; }
    const frames = path.map((q) => this.source.compute(q));
    const measure = (f) => Math.min(f.one, f.two, f.constraint), worst = frames.reduce((a, b) => (measure(b) < measure(a) ? b : a));
    this.showWay(frames, measure);
    this.say(`${name}: ${count} samples, smallest measure ${number(measure(worst))}${end}`);
  }

  // Let go, a slider is where the mechanism is.
  release() {
    if (this.wanted) { setTimeout(() => this.release(), 30); return; }
    this.panel.sliders(this.view.frame);
  }
}
