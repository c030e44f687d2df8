// Ties the view, the panel, the player and the source of frames together.
"use strict";

const PATH_WORDS = { into: "approach", along: "move within" };

class App {
  constructor(page, scene) {
    this.page = page;
    this.view = new SceneView($("view"), page.settings);
    this.view.load(scene);
    this.panel = this.makePanel({
      choose: (entry, pose) => this.choose(entry, pose),
      play: (kind) => this.play(kind),
      move: (joint, value) => this.move(joint, value),
    });
    this.source = this.makeSource({ pushed: (message) => this.pushed(message), gone: () => this.gone() });
    this.places = page.entries.flatMap((e, i) => [...Array(e.poses).keys()].map((k) => [i, k]));
    this.entry = null;
    this.pose = 0;
    this.path = null;
    this.running = false;
    this.wanted = null;
    this.turn = 0;
    this.controls();
  }

  makePanel(actions) { return new Panel(this.page, actions); }

  makeSource(handlers) { return new EngineSource(this.page, handlers); }

  controls() {
    $("prev").addEventListener("click", () => this.step(-1));
    $("next").addEventListener("click", () => this.step(1));
    $("play").addEventListener("click", () => this.toggle());
    $("fit").addEventListener("click", () => { this.view.touched = false; this.view.fit([this.view.frame]); });
    $("reset").addEventListener("click", () => this.reset());
    $("scrub").addEventListener("input", () => { this.pause(); this.at(Number($("scrub").value)); });
    for (const option of ["translation", "rotation", "lost", "axis", "axes", "visual", "bone", "floor"]) {
      const box = $(`show-${option}`);
      box.checked = this.view.options[option];
      box.addEventListener("change", () => this.view.set(option, box.checked));
    }
    for (const radio of document.querySelectorAll("input[name=mode]")) {
      radio.checked = radio.value === this.view.options.mode;
      radio.addEventListener("change", () => this.mode(radio.value));
    }
    $("nearest-pose").addEventListener("click", () => this.nearest());
    $("clearest-pose").addEventListener("click", () => this.clearest());
    $("copy").addEventListener("click", () => this.copy($("copy-as").value));
    $("save-picture").addEventListener("click", () => this.savePicture());
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => { event.preventDefault(); this.drop(event.dataTransfer.files[0]); });
    document.addEventListener("keydown", (event) => this.key(event));
  }

  mode(value) {
    this.view.set("mode", value);
    this.panel.mode = value;
    this.panel.keys();
  }

  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const onInput = event.target instanceof HTMLInputElement && event.target.type === "range";
    const onButton = event.target instanceof HTMLButtonElement;
    if (event.key === "ArrowRight" && !onInput || event.key === "n") this.step(1);
    else if (event.key === "ArrowLeft" && !onInput || event.key === "p") this.step(-1);
    else if (event.key === " " && !onButton) this.toggle();
    else if (event.key === "f") $("fit").click();
    else return;
    event.preventDefault();
  }

  async start() {
    const { frame, entry, pose } = await this.source.start();
    const shared = this.shared();
    this.select(shared ? null : entry, pose, false);
    this.frame(shared ?? frame);
    this.view.fit([shared ?? frame]);
  }

  frame(frame, dragged = -1) {
    this.view.show(frame);
    this.panel.show(frame, dragged);
    if (this.source.marks && !this.running) {
      clearTimeout(this.ticking);
      this.ticking = setTimeout(() => this.panel.ticks(this.source.marks(frame.q)), 60);
    }
  }

  // A pose in the address: #q=0.1,0.2,...
  shared() {
    const match = /^#q=([-+0-9.eE,]+)$/.exec(location.hash);
    const q = match ? match[1].split(",").map(Number) : null;
    if (!q || !this.source.compute || q.length !== this.page.joints.length || !q.every(Number.isFinite)) return null;
    return this.source.compute(q);
  }

  // To the nearest singular pose, and back.
  nearest() {
    const { verdict, q } = this.view.frame;
    if (this.before && verdict && verdict.on) { this.go(this.before); this.before = null; return; }
    if (!verdict) return;
    this.before = q.slice();
    this.go(verdict.q);
  }

  go(q) {
    ++this.turn;
    this.select(null, 0);
    const frame = this.source.compute(q);
    this.frame(frame);
    if (!this.view.touched) this.view.fit([frame]);
  }

  clearest() {
    $("playing").textContent = "looking for the clearest pose\u2026";
    setTimeout(() => {
      const { q, lower } = Engine.clearestPose(this.page.engine);
      this.go(q);
      $("playing").textContent = `at least ${(lower * 180 / Math.PI).toFixed(1)}\u00b0 from every family`;
    });
  }

  poseText(kind) {
    const q = this.view.frame.q, short = q.map((v) => Number(v.toFixed(9)));
    const link = `${location.href.split("#")[0]}#q=${short.join(",")}`;
    return { flag: `--q=${short.join(",")}`, python: `q = np.array([${short.join(", ")}])`, link,
             json: JSON.stringify({ robot: this.page.robot.name, joints: this.page.joints.map((j) => j.name), q }) }[kind];
  }

  async copy(kind) {
    const text = this.poseText(kind);
    try {
      await navigator.clipboard.writeText(text);
      $("copied").textContent = `copied: ${text}`;
    } catch {
      $("copied").textContent = text; // no right to the clipboard: here it is, to be marked by hand
    }
    if (kind === "link") history.replaceState(null, "", text);
  }

  savePicture() {
    const link = make("a");
    link.href = this.view.pictureWithLegend();
    link.download = `${this.page.robot.name}.png`;
    link.click();
  }

  // A trajectory file: its path through the tip, coloured by clearance, ready to be played.
  async drop(file) {
    if (!file || !this.source.compute) return;
    try {
      const rows = Engine.parseTrajectory(await file.text(), this.page.engine.joints);
      const step = Math.max(1, Math.ceil(rows.length / 400));
      const path = rows.filter((_, i) => i % step === 0);
      const frames = path.map((q) => this.source.compute(q));
      this.select(null, 0);
      this.path = { frames, kind: "file" };
      this.view.trail(frames.map((f) => ({ at: f.tip, clearance: f.verdict ? f.verdict.lower : Infinity })));
      const worst = frames.reduce((a, b) => ((b.verdict?.value ?? Infinity) < (a.verdict?.value ?? Infinity) ? b : a));
      this.scrub(0, frames.length - 1);
      $("playing").textContent = `${file.name}: ${rows.length} samples, nearest: ${worst.verdict ? worst.verdict.text : "no family"}`;
      this.at(0);
      this.view.fit(frames);
    } catch (error) {
      $("playing").textContent = `${file.name}: ${error.message}`;
    }
  }

  select(entry, pose, scroll = true) {
    this.pause();
    this.entry = entry;
    this.pose = pose;
    this.path = null;
    this.panel.choose(entry, pose, scroll);
    this.panel.playing(null);
    this.scrub(0, 0);
    const found = entry === null ? null : this.page.entries[entry];
    $("playing").textContent = found === null ? "" : found.poses > 1 ? `${found.name}, pose ${pose + 1} of ${found.poses}` : found.name;
  }

  async choose(entry, pose) {
    const turn = ++this.turn;
    this.select(entry, pose);
    const frame = await this.source.pose(entry, pose);
    if (turn !== this.turn) return;
    this.frame(frame);
    if (!this.view.touched) this.view.fit([frame]);
  }

  reset() { if (this.entry !== null) this.choose(this.entry, this.pose); }

  step(by) {
    if (!this.places.length) return;
    const here = this.places.findIndex(([e, k]) => e === this.entry && k === this.pose);
    const count = this.places.length;
    const [entry, pose] = this.places[here < 0 ? 0 : (here + by + count) % count];
    this.choose(entry, pose);
  }

  // "into" a singular configuration, or "along" the family.
  async play(kind) {
    if (this.entry === null) return;
    const turn = ++this.turn;
    const entry = this.page.entries[this.entry];
    this.pause();
    $("playing").textContent = "computing the path\u2026";
    const frames = await this.source.path(this.entry, this.pose, kind);
    if (turn !== this.turn) return;
    $("playing").textContent = frames.length ? `${PATH_WORDS[kind]} ${entry.name}` : `no way to ${PATH_WORDS[kind]} ${entry.name} was found here`;
    if (!frames.length) return;
    this.path = { frames, kind };
    this.drawn = -1;
    this.panel.playing(kind);
    this.scrub(0, frames.length - 1);
    if (!this.view.touched) this.view.fit(frames);
    this.resume();
  }

  scrub(value, max) {
    $("scrub").max = max;
    $("scrub").value = value;
    $("scrub").disabled = max === 0;
  }

  at(place) {
    if (!this.path) return;
    this.place = Math.max(0, Math.min(place, this.path.frames.length - 1));
    const k = Math.round(this.place);
    $("scrub").value = k;
    if (k !== this.drawn || !this.running) this.frame(this.path.frames[k]);
    this.drawn = k;
  }

  toggle() {
    if (this.running) this.pause();
    else if (this.path) this.resume();
    else if (this.entry !== null) this.play(this.page.entries[this.entry].into ? "into" : "along");
  }

  icon(shape) { $("play").querySelector("path").setAttribute("d", shape); }

  pause() {
    this.running = false;
    this.icon("M4 3v10l9-5z");
  }

  resume() {
    const { frames, kind } = this.path;
    const last = frames.length - 1;
    let begin = Number($("scrub").value);
    if (kind !== "along" && begin >= last) begin = 0;
    const once = kind !== "along";
    this.running = true;
    this.icon("M4 3h3v10H4zM9 3h3v10H9z");
    const path = this.path;
    const rate = frames.length / (once ? 2.0 : 4.0); // frames a second
    const started = performance.now() - (begin / rate) * 1000;
    const tick = (now) => {
      if (!this.running || this.path !== path) return;
      const place = Math.max(0, ((now - started) / 1000) * rate);
      if (once && place >= last) { this.at(last); this.pause(); return; }
      this.at(once ? place : place % frames.length);
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  // A slider moved. One question is under way at a time; of what was asked meanwhile the last counts.
  async move(joint, value) {
    this.pause();
    if (this.path) { this.path = null; this.panel.playing(null); this.scrub(0, 0); }
    $("playing").textContent = "";
    const q = this.wanted ? this.wanted.q.slice() : this.panel.values(this.view.frame);
    q[joint] = value;
    const idle = this.wanted === null;
    this.wanted = { q, joint };
    if (!idle) return;
    const turn = ++this.turn;
    let sent = null;
    while (sent !== this.wanted) {
      sent = this.wanted;
      const frame = await this.moved(sent.q);
      if (turn !== this.turn) break;
      this.frame(frame, sent.joint);
    }
    this.wanted = null;
  }

  moved(q) { return this.source.frame(q); }

  async pushed(message) {
    if (message.play) {
      await this.choose(message.entry, message.pose);
      await this.play(message.play);
      return;
    }
    ++this.turn;
    this.select(message.entry, message.pose);
    const frame = message.frame ?? this.source.compute(message.q);
    this.frame(frame);
    if (!this.view.touched) this.view.fit([frame]);
  }

  // The page goes on by itself, where it can.
  gone() { $("program").hidden = false; }
}
