// Ties the view, the panel, the player and the source of frames together.
"use strict";

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
    for (const option of ["translation", "rotation", "lost", "axis", "visual", "bone", "floor"]) {
      const box = $(`show-${option}`);
      box.checked = this.view.options[option];
      box.addEventListener("change", () => this.view.set(option, box.checked));
    }
    for (const radio of document.querySelectorAll("input[name=mode]")) {
      radio.checked = radio.value === this.view.options.mode;
      radio.addEventListener("change", () => this.mode(radio.value));
    }
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
    this.select(entry, pose, false);
    this.frame(frame);
    this.view.fit([frame]);
  }

  frame(frame, dragged = -1) {
    this.view.show(frame);
    this.panel.show(frame, dragged);
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
    $("playing").textContent = frames.length ? `${kind} ${entry.name}` : `no path ${kind} ${entry.name} was found here`;
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
    if (kind === "into" && begin >= last) begin = 0;
    this.running = true;
    this.icon("M4 3h3v10H4zM9 3h3v10H9z");
    const path = this.path;
    const rate = frames.length / (kind === "into" ? 2.0 : 4.0); // frames a second
    const started = performance.now() - (begin / rate) * 1000;
    const tick = (now) => {
      if (!this.running || this.path !== path) return;
      const place = Math.max(0, ((now - started) / 1000) * rate);
      if (kind === "into" && place >= last) { this.at(last); this.pause(); return; }
      this.at(kind === "into" ? place : place % frames.length);
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
