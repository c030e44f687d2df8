// A mechanism with closed loops: inputs are dragged, the other joints follow; modes are chosen.

const SETTLED = 120; // ms without a move

class MechanismApp extends App {
  constructor(page, view, scene, stream) {
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

  compute(q) { return Engine.mechanismFrame(this.engine, q); }

  inputs(q) { return this.engine.actuated.map((i) => q[i]); }

  // A dragged output keeps the rest of its pose.
  hold(q) { return Engine.poseOf(this.engine, Engine.placeOf(this.engine, q)); }

  led(q, goal, hold) {
    const { engine } = this, { q: there, stop } = Engine.posed(engine, engine.pose.rows.map((row, k) => (row < 3 ? goal[row] : hold[k])), q);
    return { frame: this.compute(there), words: stop ? `the output lags behind: ${Engine.stopWords(engine, stop)}` : "" };
  }

  // Once at rest: how far the inputs and the pose go, one after the other, and the other modes.
  async rest(frame) {
    const { engine, aside } = this, { q } = frame, found = [];
    const looked = async (...asked) => { const answer = await aside.ask(...asked); return this.stale(frame) ? undefined : answer; };
    await wait(SETTLED);
    if (this.stale(frame)) return;
    aside.stop(); // a pose that came to rest twice is looked at once
    for (const [k, index] of engine.actuated.entries()) {
      const reach = await looked("stretch", q, k);
      if (reach === undefined) return;
      if (reach) this.panel.stretch(frame, index, reach);
      found.push(reach);
    }
    const modes = await looked("modesAt", q);
    if (!modes) return;
    this.panel.menu(modes.assemblies, modes.working);
    if (frame.status !== "singular") {
      const none = found.every((one) => one && !one.points.length);
      this.panel.ahead(none ? "no input alone leads to a singular pose" : Engine.aheadOf(engine, q, found)?.text);
    }
    for (const k of engine.pose.rows.keys()) {
      const reach = await looked("poseStretch", q, k, this.page.settings.reach);
      if (!reach) return;
      this.panel.stretch(frame, q.length + k, reach);
    }
    Object.assign(this, { known: frame, stretches: found });
  }

  // An input moved, or a coordinate of the pose: the output is led.
  move(index, value) {
    const { frame } = this.view, k = index - frame.q.length;
    if (k < 0) { super.move(index, value); return; }
    const goal = this.wanted?.goal?.slice() ?? this.panel.poseValues(frame);
    goal[k] = value;
    this.want({ goal, k, q: this.panel.values(frame), joint: index });
  }

  // The way starts where the mechanism is, in the turn that its sliders show.
  moved({ q, goal, k }) { return goal ? this.posed(q, goal, k) : this.driven(this.panel.values(this.view.frame), this.inputs(q)); }

  // Frame where the mechanism gets to from a closed q on the way to new inputs; `refused` says where it
  // stopped, and why.
  driven(q, inputs) {
    const { q: there, said } = Engine.inputsLed(this.engine, inputs, q);
    return { ...this.compute(there), refused: said };
  }

  // The same with the output led to a pose; k: the coordinate that was moved.
  posed(q, goal, k) {
    const { engine } = this, { q: there, stop } = Engine.posed(engine, goal, q), frame = this.compute(there);
    if (stop) {
      const { symbol, prismatic } = engine.pose.coordinates[k], text = (pose, digits) => Engine.valueText(prismatic, pose[k], digits);
      frame.refused = `infeasible: ${symbol} = ${text(goal)}. The output gets to ${text(frame.pose, 2)} ` +
        `(${Engine.stopWords(engine, stop)}); the mechanism stays there.`;
    }
    return frame;
  }

  // A pose out of an address: all joints, whose loops are closed, or the inputs alone.
  framed(q) {
    const { engine, joints } = this, { home, actuated } = engine;
    if (q.length !== joints.length) return q.length === actuated.length ? this.driven(home, q) : null;
    const { q: closed, error } = Engine.gaussNewton(engine, q, Engine.passiveOf(engine));
    if (error <= 1e-9) return this.compute(closed);
    return { ...this.compute(home), refused: "refused: with the values in the address the loops do not close; this is home." };
  }

  misfit(q) {
    const count = this.joints.length;
    return q.length === count ? "the loops do not close near the joint values of the address"
      : `the address holds ${many(q.length, "value")}; this mechanism has ${count} joints, ${this.engine.actuated.length} of them inputs`;
  }

  nearestTo(q) {
    const { engine } = this, found = Engine.aheadOf(engine, q, engine.actuated.map((_, k) => Engine.stretch(engine, q, k)));
    return found ? { q: found.q, on: false } : this.nearestListed(q);
  }

  async clearestTo(here) {
    const found = await this.search.anew("healthiestPose", [here]);
    return found && { q: found.q, words: found.q ? "the clearest pose found: measures of type 1, type 2 and constraint of at least " +
      number(found.measure) : "no regular pose within the limits was found" };
  }

  pathOf(entry, k, kind) {
    const { q, points } = this.page.entries[entry], point = { ...points[k], q: q[k] };
    return Engine[kind === "into" ? "mechanismInto" : "mechanismAlong"](this.engine, point).map((row) => this.compute(row));
  }

  reset() { if (this.entry !== null) super.reset(); else this.go(this.engine.home); }

  poseTexts() {
    const { q, pose } = this.view.frame, { robot } = this.page, flag = this.inputs(q), { json } = super.poseTexts();
    const coordinates = this.engine.pose.coordinates.map(({ symbol }) => symbol), array = (values) => `np.array([${trimmed(values).join(", ")}])`;
    return { flag, link: q,
             python: `inputs = ${array(flag)}  # ${robot.inputs.join(", ")}\npose = ${array(pose)}  # ${coordinates.join(", ")}, m and rad\nq = ${array(q)}`,
             json: { ...json, inputs: robot.inputs, pose: Object.fromEntries(coordinates.map((name, k) => [name, pose[k]])) } };
  }

  fileJoints() { return this.engine.actuated.map((i) => this.joints[i]); }

  // A file holds the inputs: the mechanism follows them from where it is, as far as the mode goes. A row may
  // be many steps from the one before, so a worker takes them.
  async follow(name, rows) {
    const places = evenly(rows), asked = () => this.search.anew("followInputs", this.view.frame.q, places.map((i) => rows[i]));
    const found = await this.meanwhile(`${name}: following the inputs\u2026`, asked);
    if (!found) return;
    const { path, row, said } = found, end = said && `; sample ${places[row] + 1}: ${said}`;
    if (!path.length) { this.say(`${name}${end}`); return; }
    const frames = path.map((q) => this.compute(q)), measure = (f) => Math.min(f.one, f.two, f.constraint);
    this.showWay(frames, { clearance: measure });
    this.say(`${name}: ${rows.length} samples, smallest measure ${number(Math.min(...frames.map(measure)))}${end}`);
  }

  // Let go, a slider is where the mechanism is.
  release() {
    if (this.wanted) setTimeout(() => this.release(), 30);
    else this.panel.sliders(this.view.frame);
  }
}
