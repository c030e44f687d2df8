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

  // Of `times` (ascending) each frame has one: seconds, or samples; by default frames are counted.
  load(frames, kind, times = frames.map((_, k) => k), timed = false) {
    this.path = { frames, kind, times, timed };
    this.drawn = -1;
    this.scrub(times[0], times[0], times.at(-1));
  }

  clear() {
    this.pause();
    this.path = null;
    this.scrub(0, 0, 0);
    $("clock").textContent = "";
  }

  scrub(value, min, max) {
    Object.assign($("scrub"), { min, max, value, disabled: max === min });
    $("spans").replaceChildren();
  }

  // Where on the bar something is: [[from, to, class], ...].
  spans(found) {
    const { times } = this.path, place = (t) => (100 * (t - times[0])) / (times.at(-1) - times[0] || 1);
    $("spans").replaceChildren(...found.map(([from, to, kind]) => onBand(kind, place(from), place(to))));
  }

  at(place) {
    if (!this.path) return;
    const { times, kind, timed } = this.path, after = times.findIndex((t) => t >= place);
    const k = after < 0 ? times.length - 1 : after > 0 && place - times[after - 1] < times[after] - place ? after - 1 : after;
    $("scrub").value = this.running ? place : times[k];
    if (kind === "file") $("clock").textContent = timed ? `${times[k].toFixed(2)} of ${times.at(-1).toFixed(2)} s` : `sample ${Number(times[k].toFixed(2))} of ${times.at(-1)}`;
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
    const { path } = this, { times, kind, timed } = path, first = times[0], last = times.at(-1), once = kind !== "along";
    let begin = Number($("scrub").value);
    if (once && begin >= last) begin = first;
    // Whoever wants no motion gets its end, and the bar to step through it.
    if (this.still.matches) { this.at(once ? last : begin); this.stopped(); return; }
    this.running = true;
    this.icon("M4 3h3v10H4zM9 3h3v10H9z", "Pause");
    // Of time as it is, if that is neither over at once nor without end.
    const seconds = timed ? Math.min(30, Math.max(2, last - first)) : once ? 2 : 4, rate = (last - first) / seconds || 1;
    const started = performance.now() - ((begin - first) / rate) * 1000;
    const tick = (now) => {
      if (!this.running || this.path !== path) return;
      const place = first + Math.max(0, ((now - started) / 1000) * rate);
      if (once && place >= last) { this.at(last); this.pause(); return; }
      this.at(once ? place : place % (last + 1));
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
}
