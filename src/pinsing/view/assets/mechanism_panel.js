// The panel of a mechanism with closed loops: sliders of its inputs, passive joints, modes.
"use strict";

const MECHANISM_NUMBERS = [
  ["one", "\u03c3 type 1", "Smallest output motion over that of the free links: zero where the output loses a direction"],
  ["two", "\u03c3 type 2", "Smallest actuator speed of a unit motion: zero where the actuators do not hold the output"],
  ["constraint", "\u03c3 loops", "Smallest over largest singular value of the loop closure: zero where the linkage gains a motion"],
  ["condition", "condition", "Fastest over slowest output motion at unit actuator speed"],
];
const KIND_WORDS = { "type 1": "Type 1 singularity", "type 2": "Type 2 singularity",
                     "type 3": "Type 3 singularity", constraint: "Constraint singularity" };
const TURN = 2 * Math.PI;
const FEW = 4; // passive joints that are listed unasked

class MechanismPanel extends Panel {
  head() {
    const { robot, joints } = this.page;
    $("chain").title = "actuated joints, output and its rows, and the length scale L that lengths are divided by";
    formula($("chain"), `${joints.length} joints \u00b7 driven by ${robot.inputs.join(", ")} \u00b7 ` +
      `output ${robot.output} (${robot.task}) \u00b7 L\u00a0=\u00a0${robot.lengthScale}\u00a0m`);
    $("bars").hidden = true;
    $("modes").hidden = false;
    $("key-hot").textContent = "self-motion with actuators or output locked";
    const { translation, rotation } = this.page.settings;
    $("ellipsoid-mode").hidden = translation === null || rotation === null;
    for (const [kind, scale] of [["translation", translation], ["rotation", rotation]]) {
      $(`key-${kind}`).hidden = scale === null;
      $(`show-${kind}`).parentElement.hidden = scale === null;
    }
    $("mode-menu").addEventListener("change", () => this.actions.mode(JSON.parse($("mode-menu").value)));
  }

  numbers() {
    const single = ["gain", "output speed", "Output speed at unit actuator speed"];
    return this.page.inputs.length > 1 ? MECHANISM_NUMBERS : [...MECHANISM_NUMBERS.slice(0, 3), single];
  }

  scale() {
    const { translation, rotation, thickness } = this.page.settings;
    const parts = [];
    if (translation !== null) parts.push(`1 m/s is drawn ${number(translation)} m long`);
    if (rotation !== null) parts.push(`1 rad/s ${parts.length ? "" : "is drawn "}${number(rotation)} m`);
    return `At unit actuator speed: ${parts.join(", ")}. What is flat is drawn up to ` +
      `${number(1000 * thickness)} mm thick, to be seen; what is very long is cut short.`;
  }

  keys() {
    const { output } = this.page.robot;
    const pure = (this.mode ?? this.page.settings.mode) === "pure";
    $("key-translation").textContent = `velocities of ${output}${pure ? " with its orientation held" : ""}`;
    const ring = this.page.settings.planar ? " (radius: how fast)" : "";
    $("key-rotation").textContent = `turning of ${output}${pure ? " in place" : ""}${ring}`;
  }

  joints() {
    const { page } = this;
    const longest = Math.max(...page.joints.map((j) => j.symbol.length), ...page.engine.pose.rows.map((_, k) => Engine.poseName(page.engine, k).length));
    $("joints").style.setProperty("--name", `${Math.min(Math.max(longest, 3), 12)}ch`);
    this.rows = [];
    this.windows = page.joints.map((j) => [j.lower, j.upper]);
    for (const index of page.inputs) {
      const found = this.row(page.joints[index], index, true);
      // Let go where the mechanism cannot follow, the slider goes back to it.
      found.slider.addEventListener("change", () => this.actions.release());
      $("joints").append(found.row);
      this.rows[index] = found;
    }
    this.pose = new PoseSliders(page, this.actions);
    $("joints").append(this.pose.node);
    $("joints-note").textContent = "Green: within reach of this slider alone, in the present mode. " +
      "Marks: singular poses on the way.";
    const passive = make("details"), count = page.joints.length - page.inputs.length;
    passive.id = "passive";
    passive.open = count <= FEW;
    passive.append(make("summary", "", `${count} passive joint${count === 1 ? "" : "s"}, solved`));
    page.joints.forEach((joint, index) => {
      if (page.inputs.includes(index)) return;
      this.rows[index] = this.row(joint, index, false);
      this.rows[index].row.classList.add("passive");
      passive.append(this.rows[index].row);
    });
    $("joints-note").parentElement.after(passive);
  }

  shown(index, value) {
    const k = this.page.engine.actuated.indexOf(index);
    return Engine.inputText(this.page.engine, k, value);
  }

  // Angles are shown in the turn of their slider.
  value(frame, joint) {
    const [low, high] = this.windows[joint];
    const value = frame.q[joint];
    if (this.page.joints[joint].prismatic || (value >= low - 1e-9 && value <= high + 1e-9)) return value;
    return low + ((((value - low) % TURN) + TURN) % TURN);
  }

  show(frame, dragged = -1, led = -1) {
    super.show(frame, dragged);
    this.pose.show(frame, led);
  }

  verdict(frame) {
    $("verdict").className = frame.status;
    $("status").textContent = KIND_WORDS[frame.kind] ?? WORDS[frame.status];
    $("rank").textContent = `\u00b7 ${frame.mode}`;
    formula($("nearest"), frame.verdict.text);
    $("refused").hidden = !frame.refused;
    formula($("refused"), frame.refused ?? "");
    this.menu([{ name: frame.mode, q: frame.q, here: true }], []);
  }

  readings(frame) {
    for (const [id] of this.numbers()) $(id).textContent = number(frame[id]);
    this.losses([...frame.lost.map((m) => m.words), ...frame.given]);
  }

  menu(assemblies, working) {
    const groups = [["At these inputs (assembly modes)", assemblies], ["At this pose (working modes)", working]];
    $("mode-menu").replaceChildren(...groups.filter(([, modes]) => modes.length > 1 || modes === assemblies).map(([title, modes]) => {
      const group = make("optgroup");
      group.label = title;
      group.append(...modes.map((mode) => {
        const option = make("option", "", mode.name);
        option.value = JSON.stringify(mode.q);
        option.selected = mode.here && modes === assemblies;
        return option;
      }));
      return group;
    }));
  }

  ahead(text) { if (text) formula($("nearest"), text); }

  // How far an input goes, with the singular poses on the way.
  stretch(frame, index, { lower, upper, whole, points }) {
    const joint = this.page.joints[index];
    const { slider, band } = this.rows[index];
    if (!joint.limited && !joint.prismatic) this.windows[index] = turnOf(lower, upper, whole);
    const [low, high] = this.windows[index];
    Object.assign(slider, { min: low, max: high });
    const shown = this.value(frame, index);
    slider.value = shown;
    const shift = shown - frame.q[index];
    const place = (v) => Math.min(100, Math.max(0, (100 * (v + shift - low)) / (high - low)));
    const reach = whole ? [0, 100] : [place(lower), place(upper)];
    band.replaceChildren(onBand("reach", ...reach), ...points.map((point) => {
      const at = point.q[index], value = whole ? low + ((((at + shift - low) % TURN) + TURN) % TURN) - shift : at;
      return onBand(`mark ${point.kind.replace(" ", "-")}`, place(value), null, `${point.kind} at ${this.shown(index, at)}`);
    }));
  }
}

// A turn that holds what is within reach: from -180 to 180 degrees if it can be that one.
function turnOf(lower, upper, whole) {
  const fits = (low) => {
    const turns = Math.ceil((low - lower) / TURN - 1e-9) * TURN;
    return upper + turns <= low + TURN + 1e-9;
  };
  const low = whole ? -Math.PI : [-Math.PI, 0, -Math.PI / 2, Math.PI / 2].find(fits) ?? (lower + upper) / 2 - Math.PI;
  return [low, low + TURN];
}

// Sliders of the output's pose: it is led, and all joints follow.
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
