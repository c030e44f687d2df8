// Plays the frames of a path: a scrub bar, a button, keys.
"use strict";

class Player {
  constructor(show, stopped) {
    this.show = show; // a frame
    this.stopped = stopped;
    this.path = null;
    this.running = false;
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    $("scrub").addEventListener("input", () => { this.pause(); this.at(Number($("scrub").value)); });
  }

  load(frames, kind) {
    this.path = { frames, kind };
    this.drawn = -1;
    this.scrub(0, frames.length - 1);
  }

  clear() {
    this.pause();
    this.path = null;
    this.scrub(0, 0);
  }

  scrub(value, max) {
    $("scrub").max = max;
    $("scrub").value = value;
    $("scrub").disabled = max === 0;
  }

  at(place) {
    if (!this.path) return;
    const k = Math.round(Math.max(0, Math.min(place, this.path.frames.length - 1)));
    $("scrub").value = k;
    if (k !== this.drawn || !this.running) this.show(this.path.frames[k]);
    this.drawn = k;
  }

  icon(shape, words) {
    $("play").querySelector("path").setAttribute("d", shape);
    $("play").setAttribute("aria-label", words);
  }

  pause() {
    const was = this.running;
    this.running = false;
    this.icon("M4 3v10l9-5z", "Play");
    if (was) this.stopped();
  }

  resume() {
    const { path } = this, { frames, kind } = path, last = frames.length - 1, once = kind !== "along";
    let begin = Number($("scrub").value);
    if (once && begin >= last) begin = 0;
    // Whoever wants no motion gets its end, and the bar to step through it.
    if (this.still.matches) { this.at(once ? last : begin); this.stopped(); return; }
    this.running = true;
    this.icon("M4 3h3v10H4zM9 3h3v10H9z", "Pause");
    const rate = frames.length / (once ? 2 : 4); // frames a second
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
}
