// Ties the view, the panel, the player and the source of frames together.
"use strict";

const SHARPER = [1e6, 1e7]; // terms of equations, one after the other, that a pose at rest is worth
// What can be shown and not: options of the view.
const SHOWN = { translation: "translation", rotation: "rotation", lost: "what is lost", axis: "axes that depend on each other",
                axes: "all joint axes", visual: "shapes", bone: "skeleton", floor: "floor" };

class App {
  constructor(page, view, scene, stream = null) {
    this.page = page;
    this.view = view;
    this.view.begin(page.settings, scene);
    $("shown").append(...Object.entries(SHOWN).map(([option, words]) => {
      const box = make("input");
      Object.assign(box, { type: "checkbox", id: `show-${option}`, checked: view.options[option] });
      box.addEventListener("change", () => view.set(option, box.checked));
      return make("label", "", box, ` ${words}`);
    }));
    this.panel = page.mechanism ? new MechanismPanel(this) : new Panel(this);
    this.source = page.mechanism ? new MechanismSource(page) : new EngineSource(page);
    this.stream = stream;
    stream?.follow(this);
    this.player = new Player((frame) => this.frame(frame), () => this.settle());
    this.take = new Take(this);
    this.postures = new Postures(this, page.postures ?? []);
    this.places = page.entries.flatMap((e, i) => [...Array(e.poses).keys()].map((k) => [i, k]));
    this.entry = null;
    this.pose = 0;
    this.wanted = null;
    this.turn = 0;
    this.drag = new Drag(this);
    this.controls();
  }

  // Whether the program behind the page reads trajectory files.
  get reads() { return this.page.live && "way" in this.page && $("program").hidden; }

  get path() { return this.player.path; }
  get running() { return this.player.running; }
  get drawn() { return this.player.drawn; }
  at(place) { this.player.at(place); }
  pause() { this.player.pause(); }

  controls() {
    $("prev").addEventListener("click", () => this.step(-1));
    $("next").addEventListener("click", () => this.step(1));
    $("play").addEventListener("click", () => this.toggle());
    $("fit").addEventListener("click", () => { this.view.touched = false; this.view.fit([this.view.frame]); });
    $("reset").addEventListener("click", () => this.reset());
    for (const radio of document.querySelectorAll("input[name=mode]")) {
      radio.checked = radio.value === this.view.options.mode;
      radio.addEventListener("change", () => this.mode(radio.value));
    }
    $("nearest-pose").addEventListener("click", () => this.nearest());
    $("clearest-pose").addEventListener("click", () => this.clearest());
    document.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("hashchange", () => this.readAddress());
    window.addEventListener("beforeprint", () => $("printed").replaceChildren(this.view.still()));
    window.addEventListener("afterprint", () => $("printed").replaceChildren());
  }

  mode(value) {
    this.view.set("mode", value);
    this.panel.mode = value;
    this.panel.keys();
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { target } = event, typing = target instanceof HTMLInputElement || target instanceof HTMLSelectElement;
    const onButton = target instanceof HTMLButtonElement || target instanceof HTMLElement && target.tagName === "SUMMARY";
    if (typing && target.type !== "checkbox") return;
    if (event.key === "ArrowRight" || event.key === "n") this.step(1);
    else if (event.key === "ArrowLeft" || event.key === "p") this.step(-1);
    else if (event.key === " " && !onButton && !typing) this.toggle();
    else if (event.key === "f") $("fit").click();
    else return;
    event.preventDefault();
  }

  say(words) {
    $("playing").textContent = words;
    $("playing").title = words; // a narrow page cuts it
  }

  async start() {
    const { q, entry, pose, words } = await (this.stream?.start() ?? this.page.start), shared = this.shared();
    this.select(shared ? null : entry, pose, false);
    const frame = shared ?? this.source.compute(q);
    this.frame(frame);
    this.view.fit([frame]);
    const { way } = this.page;
    if (this.problem) this.refuse(this.problem);
    else if (words && !shared) this.say(words);
    if (way && !shared) this.trajectory(way);
    else if (this.entry !== null) this.lookForMeetings(entry, pose);
  }

  // The links' own shapes, one after the other, so that sliders move meanwhile.
  async dress(links) {
    for (const command of commandsOf(links)) {
      this.view.viewer.handle_command_bytearray(command);
      if (!document.hidden) await nextTask();
    }
    this.view.dress();
  }

  // `dragged` is the slider that stays where it is.
  frame(frame, dragged = -1) {
    if (this.running || this.wanted) this.view.pace.moved();
    this.view.show(frame);
    $("refused").hidden = true;
    this.panel.show(frame, dragged);
    if (dragged >= 0) this.postures.mark(-1);  // moved by hand: at none of them
    this.settle();
  }

  // What takes longer is computed once the pose rests.
  settle() {
    clearTimeout(this.resting);
    if (!this.running) this.resting = setTimeout(() => this.rest(this.view.frame), 60);
  }

  rest(frame) {
    this.panel.ticks(this.source.marks(frame.q), this.source.zones(frame.q));
    if (this.entry !== null) this.panel.curve(this.entry, this.source.familyOf(this.entry), frame.q);
    this.sharpen(frame);
  }

  // What is certain of the distance, and what is found, brought together beside the page.
  async sharpen(frame) {
    const { engine } = this.page, aside = this.aside ??= new Aside(engine), onWay = ["into", "along"].includes(this.path?.kind);
    aside.stop();
    for (const terms of SHARPER) {
      if (onWay || !frame.verdict || frame.verdict.sure || (terms > SHARPER[0] && !aside.able)) return;
      const found = await aside.ask("sharpened", frame.q, frame.verdict, terms);
      if (!found || frame !== this.view.frame || this.running || this.wanted) return;
      Engine.remember(engine, found);
      frame.verdict = found;
      this.panel.verdict(frame);
    }
  }

  // What a dragged tip keeps: the rotation of the tool.
  hold(q) { return Engine.tipRotation(this.page.engine, q); }

  // The arm with its tip led towards a point, and how far it lags, in words.
  led(q, goal, hold) {
    const { engine, joints } = this.page, { q: there, left, stuck } = Engine.ledTip(engine, q, goal, hold), frame = this.source.compute(there);
    const why = frame.status !== "regular" ? "a motion is lost here"
      : stuck.length ? `at the limit of ${stuck.map((j) => joints[j].name).join(", ")}` : "slowly, or not at all, that way";
    return { frame, words: left > 0.005 * this.page.settings.reach ? `the tip lags ${number(Math.round(1000 * left))} mm behind: ${why}` : "" };
  }

  // Joints put at values, the others as they are: [[joint, value], ...].
  pick(values) {
    ++this.turn;
    if (this.path) { this.player.clear(); this.panel.playing(null); }
    const q = this.panel.values(this.view.frame);
    for (const [joint, value] of values) q[joint] = value;
    this.frame(this.source.compute(q));
  }

  // The pose in the address, as a frame; `problem` says why there is none.
  shared() {
    const { q, problem } = asked(), frame = q ? this.framed(q) : null;
    this.problem = problem || (q && !frame ? this.misfit(q) : "");
    return frame;
  }

  framed(q) { return q.length === this.page.joints.length ? this.source.compute(q) : null; }

  misfit(q) {
    const one = q.length === 1, alone = this.page.joints.length === 1;
    return `the address holds ${q.length} value${one ? "" : "s"}; this robot has ${this.page.joints.length} joint${alone ? "" : "s"}`;
  }

  // What was asked for and is not shown; until something else is.
  refuse(words) {
    this.say(words);
    $("refused").textContent = `${words}; this pose is another`;
    $("refused").hidden = false;
  }

  readAddress() {
    document.body.classList.toggle("picture", asked().picture);
    const frame = this.shared();
    if (this.problem) this.refuse(this.problem);
    else if (frame) this.go(frame.q, frame);
  }

  // To the nearest singular pose, and back.
  nearest() {
    const { q, status } = this.view.frame, back = this.before;
    if (back && back.there.every((v, j) => v === q[j])) { this.before = null; this.go(back.here); return; }
    const found = this.source.nearest(q);
    if (!found || found.on && status === "singular") { this.say(found ? "this pose is singular" : this.noneNear()); return; }
    this.go(found.q);
    this.before = { here: q, there: this.view.frame.q };
    this.panel.nearestWords("back");
    if (found.words) this.say(found.words);
  }

  noneNear() {
    const { entries } = this.page;
    return !entries.length ? "nothing singular is listed for this arm and task"
      : entries.some((e) => e.poses) ? "no singular pose was found" : "none of those listed is within the limits";
  }

  // To a pose, that of an entry or another.
  go(q, frame = this.source.compute(q), entry = null, pose = 0, scroll = true) {
    ++this.turn;
    this.select(entry, pose, scroll);
    this.frame(frame);
    if (!this.view.touched) this.view.fit([frame]);
  }

  async clearest() {
    const turn = ++this.turn;
    this.say("looking for the clearest pose\u2026");
    await new Promise((resolve) => setTimeout(resolve, 20)); // the page says first what it does
    const found = await this.source.clearest(this.view.frame.q);
    if (!found || turn !== this.turn) return;
    if (found.q) this.go(found.q);
    this.say(found.words);
  }

  // The pose as each kind of text has it.
  poseTexts() {
    const { q } = this.view.frame;
    return { flag: q, link: q, python: `q = np.array([${trimmed(q).join(", ")}])`,
             json: { robot: this.page.robot.name, joints: this.page.joints.map((j) => j.name), q } };
  }

  fileJoints() { return this.page.engine.joints; }

  // A trajectory with what is said of it, as `trajectory_data` has it: the path of the tip coloured by
  // clearance, ready to be played.
  trajectory(way, frames = way.rows.map((q) => this.source.compute(q))) {
    this.way = { ...way, frames };
    this.showWay(frames, (f) => (f.verdict ? f.verdict.lower : Infinity), way);
    $("path-box").hidden = false;
    $("path-box").className = way.tone;
    $("path-verdict").textContent = way.verdict;
    for (const part of ["lines", "notes"]) $(`path-${part}`).replaceChildren(...way[part].map((line) => make("li", "", line)));
    $("path-notes").parentElement.hidden = !way.notes.length;
    $("path-stops").replaceChildren(...way.stops.map(({ t, kind, family }) => {
      const when = way.timed ? `${t.toFixed(2)} s` : `sample ${Number(t.toFixed(2))}`, words = `${when}: ${kind} ${kind === "nearest" ? "to " : ""}${family}`;
      return press(kind, "", () => { ++this.turn; this.pause(); this.backOnWay(); this.at(t); }, words);
    }));
  }

  // A pose chosen meanwhile has put the trajectory aside.
  backOnWay() {
    const { frames, times, timed, spans } = this.way;
    if (this.path?.frames === frames) return;
    this.select(null, 0);
    this.player.load(frames, "file", times, timed);
    this.player.spans(spans);
  }

  // The same of rows that the page has read by itself, samples in radians and metres.
  follow(name, rows) {
    const { engine } = this.page, found = Engine.crossings(engine.families, rows, engine.joints, engine.task.lengthScale);
    const met = found.flatMap(({ name: family, at }) => at.map((t) => ({ t, kind: "meets", family }))).sort((a, b) => a.t - b.t).slice(0, 30);
    const step = Math.max(1, Math.ceil(rows.length / 400)), shown = rows.map((_, i) => i).filter((i) => i % step === 0 || i === rows.length - 1);
    const times = [...new Set([...shown, ...met.map(({ t }) => t)])].sort((a, b) => a - b), between = (t) => {
      const k = Math.min(Math.floor(t), rows.length - 2);
      return Number.isInteger(t) ? rows[t] : rows[k].map((v, j) => v + (t - k) * (rows[k + 1][j] - v));
    };
    const frames = times.map((t) => this.source.compute(between(t))), away = (f) => f.verdict?.value ?? Infinity;
    const worst = frames.reduce((a, b) => (away(b) < away(a) ? b : a)), beyond = [...new Set(frames.flatMap((f) => f.outside))];
    const bad = met.length > 0 || frames.some((f) => f.status === "singular");
    const stops = met.length || !worst.verdict?.q ? met : [{ t: times[frames.indexOf(worst)], kind: "nearest", family: worst.verdict.text }];
    this.trajectory({
      verdict: `${name}: ${met.length ? `crosses ${found.map((f) => f.name).join(", ")}, first at sample ${Number(met[0].t.toFixed(2))}` : bad ? "is singular at a sample" : "meets no singular configuration that this page looks for"}`,
      tone: bad ? "singular" : beyond.length || frames.some((f) => f.status !== "regular") ? "near-singular" : "regular",
      lines: [`${rows.length} sample${rows.length === 1 ? "" : "s"}, nearest: ${met.length ? "0\u00b0 (crossed)" : worst.verdict ? worst.verdict.text : "no family"}`,
              ...(beyond.length ? [`outside the limits: ${beyond.join(", ")}`] : [])],
      notes: ["read as radians and metres, one column a joint", "times are not read; samples are counted from 0", "families of several conditions are looked for at the samples, others between them too", "`pinsing check ROBOT FILE` proves what is met between samples"],
      rows: [], times, timed: false, stops, spans: met.map(({ t }) => [t, t, "meets"]),
    }, frames);
  }

  showWay(frames, clearance, { times, timed, spans } = {}) {
    this.select(null, 0);
    this.view.trail(frames.map((f) => ({ at: f.tip, clearance: clearance(f) })));
    this.player.load(frames, "file", times, timed);
    if (spans) this.player.spans(spans);
    this.at(-Infinity);
    this.view.fit(frames);
  }

  select(entry, pose, scroll = true) {
    this.player.clear();
    this.before = null;
    this.panel.nearestWords("nearest singular");
    this.entry = entry;
    this.pose = pose;
    this.panel.choose(entry, pose, scroll);
    this.panel.playing(null);
    const found = entry === null ? null : this.page.entries[entry];
    this.say(found === null ? "" : found.poses > 1 ? `${found.name}, pose ${pose + 1} of ${found.poses}` : found.name);
  }

  async choose(entry, pose) {
    this.go(this.page.entries[entry].q[pose], undefined, entry, pose);
    await this.lookForMeetings(entry, pose);
  }

  // Once for each entry: other families that it meets.
  async lookForMeetings(entry, pose) {
    this.looked ??= new Set();
    if (this.looked.has(entry)) return;
    this.looked.add(entry);
    await new Promise((resolve) => setTimeout(resolve, 150));
    for await (const found of this.source.meets(entry, pose)) this.panel.meets(entry, found);
  }

  // Where two families meet: one pose after the other.
  meet(entry, found) {
    const here = this.meeting?.found === found ? (this.meeting.k + 1) % found.poses.length : 0;
    this.meeting = { found, k: here };
    this.go(found.poses[here], undefined, entry, -1, false);
    this.say(`where ${this.page.entries[entry].name} and ${found.name} meet, pose ${here + 1} of ${found.poses.length}`);
  }

  reset() { if (this.entry !== null) this.choose(this.entry, Math.max(this.pose, 0)); }

  step(by) {
    if (!this.places.length) return;
    const here = this.places.findIndex(([e, k]) => e === this.entry && k === this.pose);
    const count = this.places.length;
    const [entry, pose] = this.places[here < 0 ? 0 : (here + by + count) % count];
    this.choose(entry, pose);
  }

  // The button of what is playing ends it.
  playOrPause(kind) {
    if (this.running && this.path.kind === kind) this.pause();
    else this.play(kind);
  }

  // "into" a singular configuration, or "along" the family.
  async play(kind) {
    if (this.entry === null) return;
    const turn = ++this.turn, entry = this.page.entries[this.entry];
    this.pause();
    this.say("computing the path\u2026");
    const frames = await this.source.path(this.entry, Math.max(this.pose, 0), kind);
    if (turn !== this.turn) return;
    this.say(frames.length ? `${PATHS[kind].said} ${entry.name}` : `no way to ${PATHS[kind].said} ${entry.name} was found here`);
    if (!frames.length) return;
    this.player.load(frames, kind);
    this.panel.playing(kind);
    if (!this.view.touched) this.view.fit(frames);
    this.player.resume();
  }

  toggle() {
    if (this.running) this.pause();
    else if (this.path || this.way) { if (!this.path) this.backOnWay(); this.player.resume(); }
    else if (this.entry !== null) this.play(this.page.entries[this.entry].into ? "into" : "along");
  }

  // A slider moved.
  move(joint, value) {
    const q = this.wanted ? this.wanted.q.slice() : this.panel.values(this.view.frame);
    q[joint] = value;
    this.want({ q, joint });
  }

  // Of moves that come at once only the last counts.
  async want(wanted) {
    if (this.path) { this.player.clear(); this.panel.playing(null); }
    this.say("");
    const idle = this.wanted === null;
    this.wanted = wanted;
    if (!idle) return;
    const turn = ++this.turn;
    await nextTask();
    if (turn === this.turn) this.frame(this.moved(this.wanted), this.wanted.joint);
    this.wanted = null;
  }

  moved({ q }) { return this.source.compute(q); }

  // A value was typed.
  typed(joint, value, text) {
    if (value !== null) { this.move(joint, value); return; }
    this.panel.show(this.view.frame);
    this.say(`${text || "nothing"} is not a number that ${this.panel.listed[joint].name} can have`);
  }

  async pushed(message) {
    if (message.play) {
      this.choose(message.entry, message.pose);
      await this.play(message.play);
      return;
    }
    ++this.turn;
    this.select(message.entry, message.pose);
    const frame = this.source.compute(message.q);
    this.frame(frame);
    if (message.words) this.say(message.words);
    else if (!this.view.touched) this.view.fit([frame]);
  }

  // The page goes on by itself.
  gone() {
    $("program").hidden = false;
    this.take.offer();
  }
}
