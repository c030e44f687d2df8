// Sliders of the output's pose: it is led, and all joints follow.
"use strict";

class PoseSliders {
  constructor(page, actions) {
    this.page = page;
    const { engine, robot } = page;
    this.node = make("div", "pose-sliders");
    const title = make("h3", "", `Pose of ${robot.output}, led`);
    title.title = "Metres and degrees in the axes of the base; roll, pitch, yaw about x, y, z";
    this.node.append(title);
    this.rows = engine.pose.rows.map((row, k) => {
      const name = Engine.poseName(engine, k), found = make("label", "joint pose-row"), slider = make("input");
      const [low, high] = this.window(k, engine.homePose[k]);
      Object.assign(slider, { type: "range", min: low, max: high, step: "any" });
      slider.setAttribute("aria-label", `${name} of ${robot.output}`);
      slider.addEventListener("input", () => actions.lead(k, Number(slider.value)));
      slider.addEventListener("change", () => actions.release());
      const value = make("span", "value"), track = make("span", "track"), band = make("span", "band");
      track.append(slider, band);
      found.append(make("span", "name", name), track, value);
      this.node.append(found);
      return { row: found, slider, value, band };
    });
  }

  window(k, home) {
    const { engine, settings } = this.page, row = engine.pose.rows[k];
    if (row < 3) return [home - settings.reach, home + settings.reach];
    const most = row === 4 && engine.pose.turn.kind !== "axis" ? Math.PI / 2 : Math.PI;
    return [-most, most];
  }

  // A turn is shown within the turn of its slider.
  value(k, value) {
    if (this.page.engine.pose.rows[k] < 3) return value;
    return value - 2 * Math.PI * Math.round(value / (2 * Math.PI));
  }

  values(frame) { return frame.pose.map((v, k) => this.value(k, v)); }

  show(frame, led) {
    this.values(frame).forEach((value, k) => {
      const { slider, value: text } = this.rows[k];
      if (value < Number(slider.min)) slider.min = value;
      if (value > Number(slider.max)) slider.max = value;
      if (k !== led) slider.value = value;
      text.textContent = Engine.poseText(this.page.engine, k, value, this.page.engine.pose.rows[k] < 3 ? 1 : 2).replace(/^-(0\.0+\D)/, "$1");
    });
  }

  // How far a coordinate goes, the others held, and where type 2 is met on the way.
  stretch(frame, k, { lower, upper, whole, below, above, points }) {
    const { engine } = this.page, { slider, band } = this.rows[k], turns = engine.pose.rows[k] > 2;
    const shown = this.value(k, frame.pose[k]), shift = shown - frame.pose[k];
    if (!turns) Object.assign(slider, { min: Math.min(slider.min, lower), max: Math.max(slider.max, upper) });
    slider.value = shown;
    const low = Number(slider.min), high = Number(slider.max), part = (v) => (100 * (v - low)) / (high - low);
    const pieces = whole ? [[low, high]] : turns ? around(lower + shift, upper + shift, low, high) : [[lower, upper]];
    const why = (end, stop) => `${Engine.poseText(engine, k, end + shift)}${stop ? `: ${Engine.stopWords(engine, stop)}` : ""}`;
    band.replaceChildren(...pieces.map(([a, b]) => onBand("reach", part(a), Math.max(part(a) + 0.6, part(b)))), ...points.map(({ kind, value }) => {
      const at = this.value(k, value);
      return onBand(`mark ${kind.replace(" ", "-")}`, part(at), null, `${kind} at ${Engine.poseText(engine, k, at)}`);
    }));
    this.rows[k].row.title = whole ? "all the way round" : `from ${why(lower, below)}\nto ${why(upper, above)}`;
  }
}

// A stretch of a turn as pieces of the slider from low to high.
function around(lower, upper, low, high) {
  const size = high - low, begin = low + ((((lower - low) % size) + size) % size), end = begin + Math.min(upper - lower, size);
  return end <= high + 1e-9 ? [[begin, end]] : [[begin, high], [low, end - size]];
}
