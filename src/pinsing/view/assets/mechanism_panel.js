// The panel of a mechanism with closed loops: sliders of its inputs and its pose, passive joints, modes.

const MECHANISM_NUMBERS = [
  ["one", "\u03c3 type 1", "Smallest output motion over that of the free links: zero where the output loses a direction"],
  ["two", "\u03c3 type 2", "Smallest actuator speed of a unit motion: zero where the actuators do not hold the output"],
  ["constraint", "\u03c3 loops", "Smallest over largest singular value of the loop closure: zero where the linkage gains a motion"],
  ["condition", "condition", "Fastest over slowest output motion at unit actuator speed"],
];
const SINGLE = ["gain", "output speed", "Output speed at unit actuator speed"];
const KIND_WORDS = { "type 1": "Type 1 singularity", "type 2": "Type 2 singularity",
                     "type 3": "Type 3 singularity", constraint: "Constraint singularity" };
const TURN = 2 * Math.PI;
const FEW = 4; // passive joints that are listed unasked

class MechanismPanel extends Panel {
  head() {
    const { robot, settings } = this.page;
    $("chain").title = "actuated joints, output and its rows, and the length scale L that lengths are divided by";
    formula($("chain"), `${this.listed.length} joints \u00b7 driven by ${robot.inputs.join(", ")} \u00b7 ` +
      `output ${robot.output} (${robot.task}) \u00b7 L\u00a0=\u00a0${robot.lengthScale}\u00a0m`);
    $("bars").hidden = true;
    $("modes").hidden = false;
    $("key-hot").textContent = "self-motion with actuators or output locked";
    for (const kind of ["translation", "rotation"]) {
      const none = settings[kind] === null;
      $(`key-${kind}`).hidden = $(`show-${kind}`).parentElement.hidden = none;
      $("ellipsoid-mode").hidden ||= none;
    }
    $("mode-menu").addEventListener("change", () => this.app.go(JSON.parse($("mode-menu").value)));
  }

  numbers() { return this.page.robot.inputs.length > 1 ? MECHANISM_NUMBERS : [...MECHANISM_NUMBERS.slice(0, 3), SINGLE]; }

  ownScale() { return ""; }

  scale() {
    const { translation, rotation, thickness } = this.page.settings, drawn = [[translation, "m/s", " long"], [rotation, "rad/s", ""]];
    const parts = drawn.filter(([scale]) => scale !== null).map(([scale, unit, long], k) => `1 ${unit} ${k ? "" : "is drawn "}${number(scale)} m${long}`);
    return `At unit actuator speed: ${parts.join(", ")}. What is flat is drawn up to ` +
      `${number(1000 * thickness)} mm thick, to be seen; what is very long is cut short.`;
  }

  keys() {
    const { robot: { output }, settings: { planar } } = this.page, [held, inPlace] = this.pure ? [" with its orientation held", " in place"] : ["", ""];
    $("key-translation").textContent = `velocities of ${output}${held}`;
    $("key-rotation").textContent = `turning of ${output}${inPlace}${planar ? " (radius: how fast)" : ""}`;
  }

  joints() {
    const { app } = this, { actuated, pose } = app.engine, count = this.listed.length, output = this.page.robot.output;
    const title = make("h3", { title: "Metres and degrees in the axes of the base; roll, pitch, yaw about x, y, z" }, `Pose of ${output}, led`);
    const few = count - actuated.length, words = `${many(few, "passive joint")}, solved`;
    const passive = make("details", { id: "passive", open: few <= FEW }, make("summary", "", words));
    this.listed = [...this.listed, ...pose.coordinates];
    this.windows = this.listed.map(({ span }) => span);
    $("joints").style.setProperty("--name", `${Math.min(Math.max(...this.listed.map((j) => j.symbol.length), 3), 12)}ch`);
    this.rows = this.listed.map((_, index) => {
      const input = actuated.includes(index), led = index >= count, found = this.row(index, input || led);
      // Let go where the mechanism cannot follow, the slider goes back to it.
      if (input || led) found.slider.addEventListener("change", () => app.release());
      else passive.append(found.row);
      found.row.classList.add(...(led ? ["pose-row"] : input ? [] : ["passive"]));
      return found;
    });
    const rows = this.rows.map(({ row }) => row);
    $("joints").append(...actuated.map((index) => rows[index]), title, ...rows.slice(count));
    $("joints-note").textContent = "Green: within reach of this slider alone, in the present mode. Marks: singular poses on the way.";
    $("joints-note").parentElement.after(passive);
  }

  own(frame, index) { return frame.q[index] ?? frame.pose[index - frame.q.length]; }

  // Angles are shown in the turn of their slider.
  value(frame, index) {
    const value = this.own(frame, index), [low, high] = this.windows[index];
    if (this.listed[index].prismatic || (value >= low - 1e-9 && value <= high + 1e-9)) return value;
    return low + turned(value - low);
  }

  poseValues(frame) { return frame.pose.map((_, k) => this.value(frame, frame.q.length + k)); }

  // A length may be led beyond the slider that it began with.
  widen(index, lower, upper) {
    const { slider } = this.rows[index], [low, high] = this.windows[index];
    this.windows[index] = [slider.min, slider.max] = [Math.min(low, lower), Math.max(high, upper)];
  }

  show(frame, dragged = -1) {
    this.poseValues(frame).forEach((value, k) => this.widen(frame.q.length + k, value, value));
    super.show(frame, dragged);
  }

  // Sliders where the mechanism is.
  sliders(frame) { this.rows.forEach(({ slider }, index) => { slider.value = this.value(frame, index); }); }

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
    $("mode-menu").replaceChildren(...groups.filter(([, modes]) => modes.length > 1 || modes === assemblies).map(([label, modes]) => {
      const options = modes.map(({ name, q, here }) => new Option(name, JSON.stringify(q), false, here && modes === assemblies));
      return make("optgroup", { label }, ...options);
    }));
  }

  ahead(text) { if (text) formula($("nearest"), text); }

  // How far an input or a coordinate of the pose goes, why no further, and the singular poses on the way.
  stretch(frame, index, { lower, upper, whole, below, above, points }) {
    const joint = this.listed[index], { name, prismatic } = joint, { row, slider, band } = this.rows[index];
    if (!prismatic && (joint.lower === null || joint.upper === null)) this.windows[index] = turnOf(lower, upper, whole);
    this.widen(index, prismatic ? lower : Infinity, prismatic ? upper : -Infinity);
    const [low, high] = this.windows[index], shown = this.value(frame, index), shift = shown - this.own(frame, index);
    slider.value = shown;
    const place = (v) => Math.min(100, Math.max(0, (100 * (v + shift - low)) / (high - low)));
    const text = (v) => Engine.valueText(prismatic, v), from = whole ? 0 : place(lower);
    const end = (v, stop) => text(v + shift) + (stop ? `: ${Engine.stopWords(this.app.engine, stop)}` : "");
    row.title = `${name}: ${whole ? "all the way round" : `from ${end(lower, below)}\nto ${end(upper, above)}`}`;
    band.replaceChildren(onBand("reach", from, whole ? 100 : Math.max(from + 0.6, place(upper))), ...points.map((point) => {
      const at = point.value ?? point.q[index], value = whole ? low + turned(at + shift - low) - shift : at;
      return onBand(`mark ${point.kind.replace(" ", "-")}`, place(value), null, `${point.kind} at ${text(at)}`);
    }));
  }
}

// An angle within the first turn.
const turned = (angle) => ((angle % TURN) + TURN) % TURN;

// A turn that holds what is within reach: from -180 to 180 degrees if it can be that one.
function turnOf(lower, upper, whole) {
  const fits = (low) => upper + Math.ceil((low - lower) / TURN - 1e-9) * TURN <= low + TURN + 1e-9;
  const low = whole ? -Math.PI : [-Math.PI, 0, -Math.PI / 2, Math.PI / 2].find(fits) ?? (lower + upper) / 2 - Math.PI;
  return [low, low + TURN];
}
