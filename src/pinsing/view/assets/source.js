// Where frames come from: the page computes them by itself. A program behind the page leads it.
"use strict";

const nextTask = () => new Promise((resolve) => setTimeout(resolve));

class EngineSource {
  constructor(page) { this.page = page; }

  compute(q) { return Engine.frameAt(this.page.engine, q); }

  // Where each joint alone would meet each family.
  marks(q) {
    const { engine, joints } = this.page;
    return joints.map((joint, j) => engine.families.flatMap((f) =>
      (f.branches.some((b) => b.equations.length > 1) ? []
        : Engine.meetings(f, q, j, joint.lower, joint.upper, joint.prismatic).map((value) => ({ value, name: f.name, text: f.text })))));
  }

  // Where each joint alone is in a zone, or not known to be outside.
  zones(q) {
    const { engine, joints, zones } = this.page;
    return zones ? joints.map((joint, j) => Engine.zonesAlong(engine, zones, q, j, joint.lower, joint.upper)) : [];
  }

  familyOf(entry) { return (this.page.engine.families ?? []).find((f) => f.entry === entry) ?? null; }

  async path(entry, k, kind) {
    const { engine, entries } = this.page, family = this.familyOf(entry), goal = entries[entry].q[k];
    await nextTask(); // the page says first what it does
    if (kind === "along" && family === null) return [];
    const path = kind === "into" ? Engine.into(engine, entries[entry].moved, goal) : Engine.along(engine, family, goal);
    return Engine.framesOf(engine, path, family);
  }

  // Other entries, with poses where the family of this one meets theirs.
  async *meets(entry, k) {
    const { engine, entries } = this.page, family = this.familyOf(entry);
    for (const other of family ? engine.families : []) {
      if (other === family || other.reachable === false) continue;
      await nextTask();
      const poses = Engine.meetingPoses(engine, family, other, entries[entry].q[k]);
      if (poses.length) yield { entry: other.entry, name: other.name, poses };
    }
  }

  // A family, or a listed pose that belongs to no family, as a search finds them.
  nearest(q) {
    const { engine, entries } = this.page, known = entries.flatMap((e, i) => (this.familyOf(i) ? e.q : []));
    const found = Engine.nearestSingular(engine, q, known), listed = this.nearestListed(q);
    if (listed && !(found && found.value <= listed.upper)) return listed;
    if (!found) return null;
    const degrees = (v) => `${((v * 180) / Math.PI).toFixed(1)}\u00b0`, sure = found.value - found.least < 1e-3;
    return { q: found.q, on: found.value <= 1e-7, words: sure ? "" : `the nearest within the limits that was found, ${degrees(found.value)} away; ` +
      (found.least > 0 ? `no listed family is nearer than ${degrees(found.least)}` : "there may be nearer ones") };
  }

  nearestListed(q) {
    const { engine, entries } = this.page, { joints, task } = engine;
    const places = entries.flatMap((entry, i) => (entry.into && this.familyOf(i) === null ? entry.q.map((pose, k) => [i, k, pose]) : []));
    const found = Engine.nearestPose(places.map(([, , pose]) => pose), q, joints, task.lengthScale);
    if (!found) return null;
    const [entry, k] = places[found.index], { name, poses } = entries[entry];
    return { ...found, on: found.upper <= 1e-9,
             words: `${name}${poses > 1 ? `, pose ${k + 1}` : ""}: the nearest that is listed; between those listed there may be others` };
  }

  // Asked of a worker of its own, so that what is looked at around a pose does not end it.
  beside(name, ...given) {
    this.aside ??= new Aside(this.page.engine);
    this.aside.stop();
    return this.aside.ask(name, ...given);
  }

  // As good as the pose shown, and as one that was computed before (`page.clearest`).
  async clearest(here) {
    const { engine, clearest: before, coverage } = this.page, degrees = (v) => ((v * 180) / Math.PI).toFixed(1);
    const found = await this.beside("clearestPose", [here, ...(before ? [before.q] : [])]);
    if (!found) return null; // asked once more meanwhile
    if (found.near) Engine.remember(engine, found.near);
    const every = (coverage ?? "").startsWith("NOT") ? "every family listed (the list is NOT complete)" : "every family";
    const { q, lower, upper } = before && before.lower >= found.lower ? { ...before, upper: before.lower } : found;
    return { q, words: upper < 1e-9 ? "no pose clear of all families was found"
      : lower === Infinity ? (engine.families.length ? "no listed family is within the limits" : "no family is listed to be clear of")
      : degrees(lower) === degrees(upper) ? `at least ${degrees(lower)}\u00b0 from ${every}`
      : `at least ${degrees(lower)}\u00b0 from ${every}; the nearest found is ${degrees(upper)}\u00b0 away` };
  }
}

class MechanismSource extends EngineSource {
  compute(q) { return Engine.mechanismFrame(this.page.engine, q); }

  // Frame where the mechanism gets to from a closed q on the way to new inputs; `refused` says where it
  // stopped, and why.
  driven(q, inputs) {
    const { q: there, said } = Engine.inputsLed(this.page.engine, inputs, q);
    return { ...this.compute(there), refused: said };
  }

  // The same with the output led to a pose; k: the coordinate that was moved.
  posed(q, goal, k) {
    const { engine } = this.page, found = Engine.posed(engine, goal, q), frame = this.compute(found.q);
    if (found.stop) {
      const name = Engine.poseName(engine, k);
      frame.refused = `infeasible: ${name} = ${Engine.poseText(engine, k, goal[k])}. The output gets to ` +
        `${Engine.poseText(engine, k, frame.pose[k], 2)} (${Engine.stopWords(engine, found.stop)}); the mechanism stays there.`;
    }
    return frame;
  }

  async path(entry, k, kind) {
    const { engine, entries } = this.page, point = { ...entries[entry].points[k], q: entries[entry].q[k] };
    await nextTask();
    const rows = kind === "into" ? Engine.mechanismInto(engine, point) : Engine.mechanismAlong(engine, point);
    return rows.map((q) => this.compute(q));
  }

  async *meets() { /* loci of a mechanism meet in poses of type 3, which the list has */ }

  nearest(q) {
    const { engine } = this.page, found = Engine.aheadOf(engine, q, engine.actuated.map((_, k) => Engine.stretch(engine, q, k)));
    return found ? { q: found.q, on: false } : this.nearestListed(q);
  }

  async clearest(here) {
    const found = await this.beside("healthiestPose", [here]);
    if (!found) return null; // asked once more meanwhile
    const { q, measure } = found;
    return { q, words: q ? `the clearest pose found: measures of type 1, type 2 and constraint of at least ${number(measure)}` : "no regular pose within the limits was found" };
  }
}

// The stream of the program behind the page: what it shows, first (`start`) and later (`app.pushed`). It is
// opened before there is anything to show.
class LiveSource {
  constructor() {
    this.app = this.shown = null;
    this.closed = false;
    this.opened = new Promise((resolve, reject) => {
      const scheme = location.protocol === "https:" ? "wss:" : "ws:";
      this.socket = new WebSocket(`${scheme}//${location.host}${location.pathname}live`);
      this.socket.onclose = () => {
        this.closed = true;
        reject(new Error("the program that serves this page does not answer"));
        this.app?.gone();
      };
      this.socket.onmessage = (event) => { this.receive(JSON.parse(event.data)); resolve(); };
    });
    this.opened.catch(() => {}); // told where it is waited for
  }

  follow(app) {
    this.app = app;
    if (this.closed) app.gone();
  }

  // What is shown before anybody follows is where the page starts.
  receive(message) {
    if (this.app && this.shown) this.app.pushed(message);
    else if (message.q) this.shown = message;
  }

  async start() {
    await this.opened;
    return this.shown;
  }
}

const ASIDE = `const Engine = engineOf();
let data;
onmessage = ({ data: asked }) => {
  if (asked.data) ({ data } = asked);
  else postMessage(Engine[asked.name](data, ...asked.given));
};`;

// Long computations beside the page, so that it moves meanwhile: the engine once more, in a worker.
class Aside {
  constructor(data) {
    this.data = data;
    this.able = typeof Worker !== "undefined";
    this.worker = this.job = null;
  }

  // What Engine[name](data, ...given) returns, one question at a time; null where `stop` came first.
  async ask(name, ...given) {
    const here = () => nextTask().then(() => Engine[name](this.data, ...given));
    if (this.able && !this.worker) this.begin();
    if (!this.able) return here();
    return new Promise((resolve) => {
      this.job = { resolve, here };
      this.worker.postMessage({ name, given });
    });
  }

  begin() {
    const address = URL.createObjectURL(new Blob([engineOf.toString(), "\n", ASIDE], { type: "text/javascript" }));
    // Where a page may have none, or it fails, the page computes by itself.
    try { this.worker = new Worker(address); } catch { this.able = false; return; }
    URL.revokeObjectURL(address);
    this.worker.onerror = () => { this.able = false; this.answer(this.job?.here()); };
    this.worker.onmessage = ({ data }) => this.answer(data);
    this.worker.postMessage({ data: this.data });
  }

  answer(found) {
    const { job } = this;
    this.job = null;
    job?.resolve(found);
  }

  // What is being computed is wanted no more.
  stop() {
    if (!this.job) return;
    this.worker?.terminate();
    this.worker = null;
    this.answer(null);
  }
}
