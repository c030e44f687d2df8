// Ties the view, the panel and the player together, and computes what they show of an arm.

const SHARPER = [1e6, 1e7]; // terms of equations, one after the other, that a pose at rest is worth
const SHOWN_AT_MOST = 400; // samples of a file
// What can be shown and not: options of the view.
const SHOWN = { translation: "translation", rotation: "rotation", lost: "what is lost", axis: "axes that depend on each other",
                axes: "all joint axes", visual: "shapes", bone: "skeleton", floor: "floor" };

const wait = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const clearanceOf = ({ verdict }) => verdict?.lower ?? Infinity;
const degrees = (angle) => ((angle * 180) / Math.PI).toFixed(1);

class App {
  constructor(page, view, scene, stream = null) {
    const { engine, entries } = page;
    Object.assign(this, { page, engine, view, stream, joints: engine.joints, entry: null, pose: 0, wanted: null, turn: 0 });
    this.view.begin(page.settings, scene);
    $("shown").append(...Object.entries(SHOWN).map(([option, words]) => {
      const onchange = (event) => view.set(option, event.target.checked);
      return make("label", "", make("input", { type: "checkbox", id: `show-${option}`, checked: view.options[option], onchange }), ` ${words}`);
    }));
    this.places = entries.flatMap(({ list, q }, i) => (list === "postures" ? [] : q.map((_, k) => [i, k])));
    this.aside = new Aside(engine); // what is looked at around a pose
    this.search = new Aside(engine); // what was asked for, which a look does not end
    this.panel = page.mechanism ? new MechanismPanel(this) : new Panel(this);
    this.player = new Player((frame) => this.frame(frame), () => this.settle());
    this.take = new Take(this);
    this.drag = new Drag(this);
    this.controls();
    stream?.follow(this);
  }

  // Whether the program behind the page reads trajectory files.
  get reads() { return this.page.live && "way" in this.page && $("program").hidden; }

  get path() { return this.player.path; }
  get running() { return this.player.running; }
  at(place) { this.player.at(place); }
  pause() { this.player.pause(); }

  controls() {
    const clicked = {
      prev: () => this.step(-1), next: () => this.step(1), play: () => this.toggle(), reset: () => this.reset(),
      fit: () => { this.view.touched = false; this.view.fit([this.view.frame]); },
      "nearest-pose": () => this.nearest(), "clearest-pose": () => this.clearest(),
    };
    for (const [id, action] of Object.entries(clicked)) $(id).addEventListener("click", action);
    for (const radio of document.querySelectorAll("input[name=mode]")) {
      radio.checked = radio.value === this.view.options.mode;
      radio.addEventListener("change", () => { this.view.set("mode", radio.value); this.panel.keys(); });
    }
    document.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("hashchange", () => this.readAddress());
    window.addEventListener("beforeprint", () => $("printed").replaceChildren(this.view.still()));
    window.addEventListener("afterprint", () => $("printed").replaceChildren());
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { target } = event, typing = target.matches?.("input, select");
    if (typing && target.type !== "checkbox") return;
    if (event.key === "ArrowRight" || event.key === "n") this.step(1);
    else if (event.key === "ArrowLeft" || event.key === "p") this.step(-1);
    else if (event.key === " " && !typing && !target.matches?.("button, summary")) this.toggle();
    else if (event.key === "f") $("fit").click();
    else return;
    event.preventDefault();
  }

  say(words) {
    $("playing").textContent = words;
    $("playing").title = words; // a narrow page cuts it
  }

  // What `work` gives; null where something else was asked for meanwhile. `words` stand until then.
  async meanwhile(words, work) {
    const turn = ++this.turn;
    this.say(words);
    const found = await wait(20).then(work); // the page says first what it does
    return turn === this.turn ? found : null;
  }

  async start() {
    const { q, entry, pose, words } = await (this.stream?.start() ?? this.page.start), shared = this.shared(), { way } = this.page;
    this.select(shared ? null : entry, pose, false);
    const frame = shared ?? this.compute(q);
    this.frame(frame);
    this.view.fit([frame]);
    if (this.problem) this.refuse(this.problem);
    else if (words && !shared) this.say(words);
    if (way && !shared) this.trajectory(way);
    else if (this.entry !== null) this.lookForMeetings(entry, pose);
  }

  // The links' own shapes, one after the other, so that sliders move meanwhile.
  async dress(links) {
    for (const command of commandsOf(links)) {
      this.view.viewer.handle_command_bytearray(command);
      if (!document.hidden) await wait();
    }
    this.view.dress();
  }

  compute(q) { return Engine.frameAt(this.engine, q); }

  // `dragged` is the slider that stays where it is.
  frame(frame, dragged = -1) {
    if (this.running || this.wanted) this.view.pace.moved();
    this.view.show(frame);
    $("refused").hidden = true;
    this.panel.show(frame, dragged);
    this.settle();
  }

  // What takes longer is computed once the pose rests.
  settle() {
    clearTimeout(this.resting);
    if (!this.running) this.resting = setTimeout(() => this.rest(this.view.frame), 60);
  }

  // Whether a frame is no longer what the page shows at rest.
  stale(frame) { return frame !== this.view.frame || this.running || this.wanted !== null; }

  // What is certain of the distance, and what is found, are brought together beside the page.
  async rest(frame) {
    const { q } = frame, { engine, aside } = this;
    this.panel.ticks(this.marks(q), this.zones(q));
    if (this.entry !== null) this.panel.curve(this.entry, this.familyOf(this.entry), q);
    aside.stop();
    for (const terms of SHARPER) {
      if (["into", "along"].includes(this.path?.kind) || !frame.verdict || frame.verdict.sure || (terms > SHARPER[0] && !aside.able)) return;
      const found = await aside.ask("sharpened", q, frame.verdict, terms);
      if (!found || this.stale(frame)) return;
      Engine.remember(engine, found);
      frame.verdict = found;
      this.panel.verdict(frame);
    }
  }

  // Where each joint alone would meet each family.
  marks(q) {
    const { families } = this.engine, single = families.filter((f) => f.branches.every((b) => b.equations.length < 2));
    return this.joints.map(({ span, prismatic }, j) => single.flatMap((f) =>
      Engine.meetings(f, q, j, ...span, prismatic).map((value) => ({ value, name: f.name, text: f.text }))));
  }

  // Where each joint alone is in a zone, or not known to be outside.
  zones(q) {
    const { zones } = this.page;
    return zones ? this.joints.map(({ span }, j) => Engine.zonesAlong(this.engine, zones, q, j, ...span)) : [];
  }

  familyOf(entry) { return (this.engine.families ?? []).find((f) => f.entry === entry) ?? null; }

  // What a dragged tip keeps: the rotation of the tool.
  hold(q) { return Engine.tipRotation(this.engine, q); }

  // The arm with its tip led towards a point, and how far it lags, in words.
  led(q, goal, hold) {
    const { q: there, left, stuck } = Engine.ledTip(this.engine, q, goal, hold), frame = this.compute(there);
    const why = frame.status !== "regular" ? "a motion is lost here"
      : stuck.length ? `at the limit of ${stuck.map((j) => this.joints[j].name).join(", ")}` : "slowly, or not at all, that way";
    return { frame, words: left > 0.005 * this.page.settings.reach ? `the tip lags ${number(Math.round(1000 * left))} mm behind: ${why}` : "" };
  }

  // Joints put at values, the others as they are: [[joint, value], ...].
  pick(values) {
    ++this.turn;
    this.unload();
    const q = this.panel.values(this.view.frame);
    for (const [joint, value] of values) q[joint] = value;
    this.frame(this.compute(q));
  }

  // No path is played any more.
  unload() {
    if (!this.path) return;
    this.player.clear();
    this.panel.playing(null);
  }

  // The pose in the address, as a frame; `problem` says why there is none.
  shared() {
    const { q, problem } = asked(), frame = q ? this.framed(q) : null;
    this.problem = problem || (q && !frame ? this.misfit(q) : "");
    return frame;
  }

  framed(q) { return q.length === this.joints.length ? this.compute(q) : null; }

  misfit(q) { return `the address holds ${many(q.length, "value")}; this robot has ${many(this.joints.length, "joint")}`; }

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
    const { q, status } = this.view.frame, back = this.before, entries = this.page.entries.filter(({ list }) => list === "entries");
    if (back && back.there.every((v, j) => v === q[j])) { this.before = null; this.go(back.here); return; }
    const found = this.nearestTo(q);
    if (!found || found.on && status === "singular") {
      this.say(found ? "this pose is singular" : !entries.length ? "nothing singular is listed for this arm and task"
        : entries.some((e) => e.poses) ? "no singular pose was found" : "none of those listed is within the limits");
      return;
    }
    this.go(found.q);
    this.before = { here: q, there: this.view.frame.q };
    this.panel.nearestWords("back");
    if (found.words) this.say(found.words);
  }

  // Of a family, or a listed pose that belongs to no family, as a search finds them: { q, on, words }.
  nearestTo(q) {
    const known = this.page.entries.flatMap((e, i) => (this.familyOf(i) ? e.q : []));
    const found = Engine.nearestSingular(this.engine, q, known), listed = this.nearestListed(q);
    if (listed && !(found && found.value <= listed.away)) return listed;
    if (!found) return null;
    const { value, least } = found, others = least > 0 ? `no listed family is nearer than ${degrees(least)}\u00b0` : "there may be nearer ones";
    return { q: found.q, on: value <= 1e-7,
             words: value - least < 1e-3 ? "" : `the nearest within the limits that was found, ${degrees(value)}\u00b0 away; ${others}` };
  }

  nearestListed(here) {
    const away = (q) => Engine.farFrom(q, here, this.engine);
    const listed = this.page.entries.flatMap(({ name, poses, q, into }, i) => (into && !this.familyOf(i) ? q.map((pose, k) =>
      ({ q: pose, away: away(pose), words: `${name}${poses > 1 ? `, pose ${k + 1}` : ""}` })) : []));
    if (!listed.length) return null;
    const best = listed.reduce((a, b) => (b.away < a.away ? b : a));
    return { ...best, on: best.away <= 1e-9, words: `${best.words}: the nearest that is listed; between those listed there may be others` };
  }

  // To a pose, that of an entry or another.
  go(q, frame = this.compute(q), entry = null, pose = 0, scroll = true) {
    ++this.turn;
    this.select(entry, pose, scroll);
    this.frame(frame);
    if (!this.view.touched) this.view.fit([frame]);
  }

  async clearest() {
    const found = await this.meanwhile("looking for the clearest pose\u2026", () => this.clearestTo(this.view.frame.q));
    if (!found) return;
    if (found.q) this.go(found.q);
    this.say(found.words);
  }

  // As good as the pose shown, and as one that was computed before (`page.clearest`): { q, words }.
  async clearestTo(here) {
    const { engine } = this, { clearest: before, coverage } = this.page;
    const found = await this.search.anew("clearestPose", [here, ...(before ? [before.q] : [])]);
    if (!found) return null; // asked once more meanwhile
    if (found.near) Engine.remember(engine, found.near);
    const every = (coverage ?? "").startsWith("NOT") ? "every family listed (the list is NOT complete)" : "every family";
    const { q, lower, upper } = before && before.lower >= found.lower ? { ...before, upper: before.lower } : found;
    const least = `at least ${degrees(lower)}\u00b0 from ${every}`;
    return { q, words: upper < 1e-9 ? "no pose clear of all families was found"
      : lower === Infinity ? (engine.families.length ? "no listed family is within the limits" : "no family is listed to be clear of")
      : degrees(lower) === degrees(upper) ? least : `${least}; the nearest found is ${degrees(upper)}\u00b0 away` };
  }

  // The pose as each kind of text has it.
  poseTexts() {
    const { q } = this.view.frame;
    return { flag: q, link: q, python: `q = np.array([${trimmed(q).join(", ")}])`,
             json: { robot: this.page.robot.name, joints: this.joints.map((j) => j.name), q } };
  }

  fileJoints() { return this.joints; }

  // A trajectory with what is said of it, as `trajectory_data` has it: the path of the tip coloured by
  // clearance, ready to be played.
  trajectory(way, frames = way.rows.map((q) => this.compute(q))) {
    this.way = { ...way, frames };
    this.showWay(frames, way);
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
    this.player.load(frames, "file", times, timed, spans);
  }

  // The same of rows that the page has read by itself, samples in radians and metres.
  follow(name, rows) {
    const { families, joints } = this.engine, found = Engine.crossings(families, rows, joints);
    const met = found.flatMap(({ name: family, at }) => at.map((t) => ({ t, kind: "meets", family }))).sort((a, b) => a.t - b.t).slice(0, 30);
    const times = [...new Set([...evenly(rows), ...met.map(({ t }) => t)])].sort((a, b) => a - b);
    const frames = times.map((t) => this.compute(Engine.rowAt(rows, t))), away = (f) => f.verdict?.value ?? Infinity;
    const worst = frames.reduce((a, b) => (away(b) < away(a) ? b : a)), beyond = [...new Set(frames.flatMap((f) => f.outside))];
    const bad = met.length > 0 || frames.some((f) => f.status === "singular"), verdict = met.length
      ? `meets ${found.map((f) => f.name).join(", ")}, first at sample ${Number(met[0].t.toFixed(2))}`
      : bad ? "is singular at a sample" : "meets no singular configuration that this page looks for";
    this.trajectory({
      verdict: `${name}: ${verdict}`,
      tone: bad ? "singular" : beyond.length || frames.some((f) => f.status !== "regular") ? "near-singular" : "regular",
      lines: [`${many(rows.length, "sample")}, nearest: ${met.length ? "0\u00b0 (crossed)" : worst.verdict ? worst.verdict.text : "no family"}`,
              ...(beyond.length ? [`outside the limits: ${beyond.join(", ")}`] : [])],
      notes: ["read as radians and metres, one column a joint", "times are not read; samples are counted from 0", "families of several conditions are looked for at the samples, others between them too", "`pinsing check ROBOT FILE` proves what is met between samples"],
      stops: met.length || !worst.verdict?.q ? met : [{ t: times[frames.indexOf(worst)], kind: "nearest", family: worst.verdict.text }],
      times, timed: false, spans: met.map(({ t }) => [t, t, "meets"]),
    }, frames);
  }

  // A path of the tip, coloured by clearance, at its begin; that of an entry or none.
  showWay(frames, { clearance = clearanceOf, entry = null, times, timed, spans }) {
    this.select(entry, 0);
    this.view.trail(frames.map((f) => ({ at: f.tip, clearance: clearance(f) })));
    this.player.load(frames, "file", times, timed, spans);
    this.at(-Infinity);
    this.view.fit(frames);
  }

  select(entry, pose, scroll = true) {
    this.player.clear();
    this.before = null;
    this.panel.nearestWords("nearest singular");
    Object.assign(this, { entry, pose });
    this.panel.choose(entry, pose, scroll);
    this.panel.playing(null);
    const found = entry === null ? null : this.page.entries[entry];
    this.say(found === null ? "" : found.poses > 1 ? `${found.name}, pose ${pose + 1} of ${found.poses}` : found.said ?? found.name);
  }

  // Of a posture the way to it is played where there is one.
  async choose(entry, pose) {
    const { list, q, way } = this.page.entries[entry];
    if (list === "postures") this.view.trail([]);
    if (!way) {
      this.go(q[pose], undefined, entry, pose);
      await this.lookForMeetings(entry, pose);
      return;
    }
    ++this.turn;
    this.showWay(way.map((row) => this.compute(row)), { entry });
    this.player.resume();
  }

  // Once for each entry: other families that it meets, with poses on both.
  async lookForMeetings(entry, pose) {
    const { engine } = this, family = this.familyOf(entry);
    this.looked ??= new Set();
    if (!family || this.looked.has(entry)) return;
    this.looked.add(entry);
    await wait(150);
    for (const other of engine.families) {
      if (other === family || other.reachable === false) continue;
      await wait();
      const poses = Engine.meetingPoses(engine, family, other, this.page.entries[entry].q[pose]);
      if (poses.length) this.panel.meets(entry, { name: other.name, poses });
    }
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
    const count = this.places.length, here = this.places.findIndex(([e, k]) => e === this.entry && k === this.pose);
    if (count) this.choose(...this.places[here < 0 ? 0 : (here + by + count) % count]);
  }

  // The button of what is playing ends it.
  playOrPause(kind) {
    if (this.running && this.path.kind === kind) this.pause();
    else this.play(kind);
  }

  // "into" a singular configuration, or "along" the family.
  async play(kind) {
    if (this.entry === null) return;
    const { entry: index, pose } = this, { name } = this.page.entries[index], { said } = PATHS[kind];
    this.pause();
    const frames = await this.meanwhile("computing the path\u2026", () => this.pathOf(index, Math.max(pose, 0), kind));
    if (!frames) return;
    this.say(frames.length ? `${said} ${name}` : `no way to ${said} ${name} was found here`);
    if (!frames.length) return;
    this.player.load(frames, kind);
    this.panel.playing(kind);
    if (!this.view.touched) this.view.fit(frames);
    this.player.resume();
  }

  pathOf(entry, k, kind) {
    const { engine } = this, family = this.familyOf(entry), { moved, q } = this.page.entries[entry];
    if (kind === "along" && !family) return [];
    return Engine.framesOf(engine, kind === "into" ? Engine.into(engine, moved, q[k]) : Engine.along(engine, family, q[k]), family);
  }

  toggle() {
    const { into, along } = this.page.entries[this.entry] ?? {};
    if (this.running) this.pause();
    else if (this.path || this.way) { if (!this.path) this.backOnWay(); this.player.resume(); }
    else if (into || along) this.play(into ? "into" : "along");
  }

  // A slider moved.
  move(joint, value) {
    const q = this.wanted ? this.wanted.q.slice() : this.panel.values(this.view.frame);
    q[joint] = value;
    this.want({ q, joint });
  }

  // Of moves that come at once only the last counts.
  async want(wanted) {
    this.unload();
    this.say("");
    const idle = this.wanted === null;
    this.wanted = wanted;
    if (!idle) return;
    const turn = ++this.turn;
    await wait();
    if (turn === this.turn) this.frame(this.moved(this.wanted), this.wanted.joint);
    this.wanted = null;
  }

  moved({ q }) { return this.compute(q); }

  // A value was typed.
  typed(joint, value, text) {
    if (value !== null) { this.move(joint, value); return; }
    this.panel.show(this.view.frame);
    this.say(`${text || "nothing"} is not a number that ${this.panel.listed[joint].name} can have`);
  }

  async pushed(message) {
    const { q, entry, pose, play, words } = message;
    if (play) {
      this.choose(entry, pose);
      await this.play(play);
      return;
    }
    ++this.turn;
    this.select(entry, pose);
    const frame = this.compute(q);
    this.frame(frame);
    if (words) this.say(words);
    else if (!this.view.touched) this.view.fit([frame]);
  }

  // The page goes on by itself.
  gone() {
    $("program").hidden = false;
    this.take.offer();
  }
}

// Places of rows of a file, evenly, the last among them.
function evenly(rows) {
  const step = Math.max(1, Math.ceil(rows.length / SHOWN_AT_MOST));
  return [...rows.keys()].filter((i) => i % step === 0 || i === rows.length - 1);
}
