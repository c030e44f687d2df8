// Plays the frames of a path: a scrub bar, a button, keys.

const ICONS = { Play: "M4 3v10l9-5z", Pause: "M4 3h3v10H4zM9 3h3v10H9z" };

class Player {
  constructor(show, stopped) {
    this.show = show; // a frame
    this.stopped = stopped;
    this.path = null;
    this.running = false;
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    $("scrub").addEventListener("input", () => { this.pause(); this.at(Number($("scrub").value)); });
  }

  // Of `times` (ascending) each frame has one: seconds, or samples; by default frames are counted. `spans`
  // are shown on the bar: [[from, to, class], ...].
  load(frames, kind, times = frames.map((_, k) => k), timed = false, spans = []) {
    const first = times[0], last = times.at(-1), place = (t) => (100 * (t - first)) / (last - first || 1);
    this.path = { frames, kind, times, timed, first, last };
    this.drawn = -1;
    this.bar(first, last, spans.map(([from, to, what]) => onBand(what, place(from), place(to))));
  }

  clear() {
    this.pause();
    this.path = null;
    this.bar(0, 0, []);
    $("clock").textContent = "";
  }

  bar(min, max, spans) {
    Object.assign($("scrub"), { min, max, value: min, disabled: max === min });
    $("spans").replaceChildren(...spans);
  }

  at(place) {
    if (!this.path) return;
    const { frames, times, kind, timed, last } = this.path, after = times.findIndex((t) => t >= place);
    const k = after < 0 ? times.length - 1 : after > 0 && place - times[after - 1] < times[after] - place ? after - 1 : after;
    $("scrub").value = this.running ? place : times[k];
    if (kind === "file") $("clock").textContent = timed ? `${times[k].toFixed(2)} of ${last.toFixed(2)} s` : `sample ${Number(times[k].toFixed(2))} of ${last}`;
    if (k !== this.drawn || !this.running) this.show(frames[k]);
    this.drawn = k;
  }

  run(running) {
    this.running = running;
    const words = running ? "Pause" : "Play";
    $("play").querySelector("path").setAttribute("d", ICONS[words]);
    $("play").setAttribute("aria-label", words);
  }

  pause() {
    const was = this.running;
    this.run(false);
    if (was) this.stopped();
  }

  resume() {
    const { path } = this, { kind, timed, first, last } = path, once = kind !== "along", shown = Number($("scrub").value);
    const begin = once && shown >= last ? first : shown;
    // Whoever wants no motion gets its end, and the bar to step through it.
    if (this.still.matches) { this.at(once ? last : begin); this.stopped(); return; }
    this.run(true);
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
