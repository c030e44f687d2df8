// The side panel: all text goes in as text nodes, never as markup.
"use strict";

const $ = (id) => document.getElementById(id);

// An element and what it holds: words, or other elements.
function make(tag, className = "", ...content) {
  const node = document.createElement(tag);
  if (className) node.className = className;
  node.append(...content);
  return node;
}

// A button and what it does.
function press(className, title, action, ...content) {
  const node = make("button", className, ...content);
  node.title = title;
  node.addEventListener("click", action);
  return node;
}

// Something on the band of a slider, from one percentage of its length to another, or at one.
function onBand(className, from, to = null, title = "") {
  const node = make("span", className);
  node.style.left = `${from}%`;
  if (to !== null) node.style.width = `${to - from}%`;
  node.title = title;
  return node;
}

// "q5 = 0" with the 5 set low.
function formula(node, text) {
  node.replaceChildren();
  for (const part of text.split(/(\b[a-z]\d+\b)/)) {
    if (/^[a-z]\d+$/.test(part)) node.append(part[0], make("sub", "", part.slice(1)));
    else node.append(part.replace(/(^|[\s(])-(?=[\s\d(a-z])/g, "$1\u2212"));
  }
  return node;
}

function number(value) {
  if (value === "inf" || value === Infinity) return "\u221e";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size < 1e-3 || size >= 1e5) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

// How much of names is the same in all of them, up to a mark that separates words.
function commonPrefix(names) {
  const [first, ...rest] = names;
  let end = 0;
  if (rest.length) for (let k = 0; k < first.length && rest.every((name) => name.startsWith(first.slice(0, k + 1))); k++) {
    if (/[_\-./:\s]/.test(first[k])) end = k + 1;
  }
  return names.some((name) => name.length === end) ? 0 : end;
}

// Whether an ellipsoid is drawn thicker than it is, and why, in a word; scale: metres for its unit.
function thickened({ drawn, radii }, scale) {
  const thin = radii.filter((r, k) => drawn[k] > 1.05 * scale * r).length;
  return thin === 1 ? "flat, drawn thicker" : thin === 2 ? "a line, drawn thicker" : "";
}

// What the note begins with where only the rounding of the file keeps a pose from being singular.
const ROUNDED_AWAY = "singular if the rounded numbers of the file";

const WORDS = { singular: "Singular", "near-singular": "Near-singular", regular: "Regular" };

// What is played from an entry: on its button, of the button, and while it plays.
const PATHS = {
  into: { button: "\u25b6 approach", title: "From a regular configuration into this one", said: "approach" },
  along: { button: "\u25b6 move within", title: "Within the family, singular all the way", said: "move within" },
};

// What is read at an arm: label, title, and where it goes.
const ARM_NUMBERS = [
  ["ratio", "\u03c3_min/\u03c3_max", "Smallest singular value over the largest: 0 at a singularity"],
  ["sigma-min", "\u03c3 min", "Smallest singular value that is not zero everywhere"],
  ["condition", "condition", "Largest singular value over the smallest"],
  ["manipulability", "manipulability", "Product of the singular values (Yoshikawa)"],
];

// Values of joints that turn and that slide, as they are shown and typed.
const TURNS = { unit: "\u00b0", said: "degrees", size: Math.PI / 180, digits: 2, end: /\s*(\u00b0|deg)?\s*$/ };
const SLIDES = { unit: " mm", said: "millimetres", size: 1e-3, digits: 1, end: /\s*(mm)?\s*$/ };
const unitOf = (joint) => (joint.prismatic ? SLIDES : TURNS);

class Panel {
  constructor(app) {
    const { page } = app;
    this.app = app;
    this.page = page;
    $("robot").textContent = page.robot.name;
    this.head();
    this.keys();
    $("numbers").replaceChildren(...this.numbers().map(([id, label, title]) => {
      const name = make("dt", "", label), value = make("dd");
      Object.assign(name, { title });
      Object.assign(value, { id });
      return make("div", "", name, value);
    }));
    $("scale").textContent = this.scale();
    const own = this.ownScale();
    if (own) $("numbers").after(make("p", "note own-scale", own));
    const singular = page.entries.filter((entry) => !entry.given).length;
    $("count").textContent = singular ? `(${singular})` : "";
    if (page.coverage) {
      // An empty list says itself that there are no others.
      $("coverage").textContent = singular ? page.coverage : page.coverage.replace("Proven: there are no others.", "Proven.");
      $("coverage").hidden = false;
      $("coverage").classList.toggle("warning", page.coverage.startsWith("NOT"));
    }
    if (page.notes.length) {
      $("notes-box").hidden = false;
      const warns = (n) => n.startsWith("WARNING");
      $("notes").append(...page.notes.map((n) => make("li", warns(n) ? "warning" : "", n)));
      $("notes-box").open = page.notes.some(warns);
    }
    this.entries();
    this.joints();
  }

  head() {
    const { page } = this;
    $("chain").title = "base, tip, task, and the length scale L that translations are divided by";
    $("chain").textContent = `${page.robot.base} \u2192 ${page.robot.tip} \u00b7 ${page.joints.length} joint${page.joints.length === 1 ? "" : "s"} \u00b7 ` +
      `${page.robot.task} task \u00b7 L\u00a0=\u00a0${page.robot.lengthScale}\u00a0m`;
  }

  numbers() { return ARM_NUMBERS; }

  // The verdict and its ratio do not hang on the user's length scale; the other numbers do.
  ownScale() {
    const { judge, task } = this.page.engine;
    if (!judge.columns || judge.length === task.lengthScale && judge.columns.every((c) => c === 1)) return "";
    const sliders = judge.columns.some((c) => c !== 1) ? " (joints that slide are scaled by it too)" : "";
    return `Verdict, \u03c3min/\u03c3max and what is nearly lost: at the arm\u2019s own length of ${number(judge.length)} m${sliders}; ` +
      `the other numbers: at L = ${number(task.lengthScale)} m.`;
  }

  scale() {
    const { translation, rotation, thickness } = this.page.settings;
    return `Ellipsoids at unit joint speed: 1 m/s is drawn ${number(translation)} m long, ` +
      `1 rad/s ${number(rotation)} m. What is flat is drawn up to ${number(1000 * thickness)} mm thick, to be seen.`;
  }

  keys() {
    const mode = this.mode ?? this.page.settings.mode, pure = mode === "pure";
    for (const [kind, words] of [["translation", pure ? "translation with orientation held" : "tip velocity, whatever the rotation"],
                                 ["rotation", pure ? "rotation with the tip held" : "angular velocity, whatever the translation"]]) {
      const key = $(`key-${kind}`), drawn = this.frame ? thickened(this.frame.ellipsoids[mode][kind], this.page.settings[kind]) : "";
      key.textContent = words + (drawn && `: ${drawn}`);
      key.title = drawn ? "Drawn thicker than it is, to be seen" : "";
    }
  }

  entries() {
    if (this.page.entries.every((entry) => entry.given)) $("entries").append(make("li", "note", this.noEntries()));
    this.items = this.page.entries.map((entry, index) => {
      const { name, poses, titles } = entry, text = make("span", "text", make("b", "", name), formula(make("span"), entry.text));
      const more = formula(make("span", "more"), entry.more.join(" \u00b7 "));
      const button = press("entry", entry.reason, () => this.app.choose(index, 0), text, more);
      const row = make("div", "actions"), item = make("li", poses ? "" : "away", button, row);
      button.disabled = !poses;
      row.hidden = true;
      for (let k = 0; poses > 1 && k < poses; k++) {
        row.append(press("pose", titles?.[k] ?? `Pose ${k + 1} of ${name}`, () => this.app.choose(index, k), k ? k + 1 : "pose 1"));
      }
      for (const [kind, { button: words, title }] of Object.entries(PATHS)) {
        if (entry[kind]) row.append(press(`path ${kind}`, title, () => this.app.playOrPause(kind), words));
      }
      if (entry.solved?.length) {
        const box = statement(entry.solved);
        box.hidden = true;
        item.append(box);
      }
      $(entry.given ? "given" : "entries").append(item);
      $("given-box").hidden &&= !entry.given;
      return item;
    });
  }

  // What an empty list means hangs on how sure it is.
  noEntries() {
    const { coverage } = this.page;
    return !coverage ? "None is listed; that there are none is not said here."
      : coverage.startsWith("Proven") ? "None: this arm has no singular configuration for this task."
      : coverage.startsWith("NOT") ? "None was found." : "None was found, and nothing is known to be missing.";
  }

  // A button for the poses where this entry's family meets another.
  meets(entry, found) {
    const button = press("meet", "A pose on both; once more for the next", () => this.app.meet(entry, found), `meets ${found.name}`);
    this.items[entry].querySelector(".actions").append(button);
  }

  // The curve of the chosen entry's equation.
  curve(entry, family, q) {
    if (this.drawn?.entry !== entry) {
      this.drawn?.locus.node.remove();
      const joints = this.page.engine.joints, has = family !== null && Engine.curveBranch(family, q, joints);
      this.drawn = has ? { entry, locus: new Locus(this.app, family, q) } : null;
      if (has) this.items[entry].append(this.drawn.locus.node);
    } else this.drawn.locus.draw(q);
  }

  nearestWords(words) { $("nearest-pose").textContent = words; }

  joints() {
    const common = commonPrefix(this.page.joints.map((joint) => joint.name));
    this.listed = this.page.joints;
    this.rows = this.listed.map((joint, index) => {
      const found = this.row(index, true);
      found.row.classList.add("named");
      const name = make("span", "name", formula(make("b"), joint.symbol), make("small", "", joint.name === joint.symbol ? "" : joint.name.slice(common)));
      found.row.querySelector(".name").replaceWith(name);
      found.value.after(make("small", "limits", this.limits(joint)));
      $("joints").append(found.row);
      return found;
    });
    $("joints-note").textContent = this.page.entries.length ? "Ticks: where this joint alone meets a family." : "";
    if (this.page.zones) $("joints-note").append(` Red: ${this.page.zones.why}.`);
  }

  limits(joint) {
    if (joint.limited === false) return "no limits";
    // As many digits as they need, at most two, and one of large values.
    const shown = (v) => Number(v.toFixed(Math.abs(v) < 100 ? 2 : 1)) + 0, { unit, size } = unitOf(joint);
    const ends = [joint.lower, joint.upper].map((v) => shown(v / size));
    return ends[0] === ends[1] ? `cannot move: ${ends[0]}${unit}` : `${ends[0]} \u2026 ${ends[1]}${unit}`;
  }

  // Where each slider alone would meet a family.
  ticks(marks, zones) {
    marks.forEach((found, i) => {
      const { lower, upper } = this.page.joints[i], part = (value) => (100 * (value - lower)) / (upper - lower);
      const inside = (zones[i] ?? []).map(([a, b]) => onBand("zone", part(a), part(b)));
      this.rows[i].band?.replaceChildren(...inside, ...found.map(({ value, name, text }) => onBand("mark", part(value), null, `${name}: ${text}`)));
    });
  }

  // A slider with the joint's name and value, both to be moved; a fixed one only follows.
  row(index, moves) {
    const joint = this.listed[index], row = make("div", "joint"), slider = make("input"), value = make("span", "value");
    row.title = joint.name;
    Object.assign(slider, { type: "range", min: joint.lower, max: joint.upper, step: "any", disabled: !moves });
    slider.setAttribute("aria-label", joint.name);
    row.append(formula(make("span", "name"), joint.symbol), slider, value);
    if (!moves) return { row, slider, value };
    const typed = make("input", "typed"), track = make("span", "track"), band = make("span", "band");
    const { unit, said, size, end } = unitOf(joint), moved = () => this.app.move(index, Number(slider.value));
    slider.replaceWith(track);
    track.append(slider, band);
    value.append(typed, unit);
    slider.addEventListener("input", moved);
    Object.assign(typed, { type: "text", inputMode: "decimal", autocomplete: "off" });
    typed.setAttribute("aria-label", `${joint.name}, ${said}`);
    typed.addEventListener("change", () => {
      const text = typed.value.replace(",", ".").replace("\u2212", "-").replace(end, "").trim(), given = Number(text) * size;
      const wrong = !NUMBER.test(text) || Math.abs(given) > HUGE;
      if (!wrong) slider.value = given;
      this.app.typed(index, wrong ? null : given, typed.value);
    });
    row.addEventListener("keydown", (event) => {
      const up = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1 }[event.key];
      if (!up || event.ctrlKey || event.altKey || event.metaKey || event.target === typed && !/Up|Down/.test(event.key)) return;
      event.preventDefault();
      const next = Number(slider.value) + up * size * (event.shiftKey ? 0.1 : 1);
      slider.value = Math.min(Number(slider.max), Math.max(Number(slider.min), next));
      moved();
    });
    return { row, slider, value, typed, band };
  }

  show(frame, dragged = -1) {
    this.frame = frame;
    this.keys();
    this.verdict(frame);
    this.readings(frame);
    $("why").textContent = frame.why.length ? `because ${frame.why.join("; ")}` : "";
    $("remarks").textContent = frame.notes.join("; ");
    const limits = (name) => { const joint = this.page.joints.find((j) => j.name === name); return joint ? ` (${this.limits(joint)})` : ""; };
    $("outside").hidden = !frame.outside.length;
    $("outside").textContent = frame.outside.length ? `outside the limits: ${frame.outside.map((name) => name + limits(name)).join(", ")}` : "";
    this.rows.forEach(({ row, slider, value, typed }, i) => {
      const joint = this.listed[i], shown = this.value(frame, i), { unit, size, digits } = unitOf(joint);
      row.classList.toggle("hot", frame.hot.includes(i));
      row.classList.toggle("beyond", frame.outside.includes(joint.name));
      if (i !== dragged) slider.value = shown;
      const text = (shown / size).toFixed(digits).replace(/^-(0\.0+)$/, "$1");
      if (!typed) value.textContent = text + unit;
      else typed.value = text;
    });
  }

  value(frame, joint) { return frame.q[joint]; }
  values(frame) { return frame.q.map((_, i) => this.value(frame, i)); }

  verdict(frame) {
    $("verdict").className = frame.status;
    $("status").textContent = WORDS[frame.status];
    const rounded = frame.notes.some((note) => note.startsWith(ROUNDED_AWAY));
    $("rank").textContent = `\u00b7 rank ${frame.rank} of ${frame.genericRank}` +
      (rounded ? " \u00b7 singular but for the rounding of the file" : "");
    if (frame.verdict) formula($("nearest"), frame.verdict.text);
    else $("nearest").textContent = "";
  }

  readings(frame) {
    const found = { ...frame, "sigma-min": frame.sigma[frame.genericRank - 1] };
    for (const [id] of ARM_NUMBERS) $(id).textContent = number(found[id]);
    const zero = frame.status === "singular";
    $("bars").replaceChildren(...frame.sigma.slice(0, frame.genericRank).map((s, i) => {
      const none = zero && i >= frame.rank, bar = make("div", none ? "zero" : "", make("span", "", none ? "0" : number(Number(s.toPrecision(2)))));
      bar.style.height = `${(100 * s) / frame.sigma[0]}%`;
      return bar;
    }));
    $("speeds").textContent = frame.speeds ? this.speeds(frame.speeds) : "";
    const { mixed, always } = frame, all = frame.lost.length;
    this.losses([...frame.lost.map((m) => m.words), ...(mixed
      ? [`(${mixed} of these ${all} ${mixed === 1 ? "is" : "are"} missing at every configuration: the arm reaches rank ` +
         `${frame.genericRank} in a task of ${this.page.engine.task.rows.length} rows)`] : [])]);
    $("always").hidden = !always.length;
    $("always").textContent = `${always.length} motion${always.length === 1 ? " is" : "s are"} missing at every configuration; here: ${always.join("; ")}`;
  }

  speeds({ linear, angular, share }) {
    const said = ({ speed, joints, direction }, unit, what, word) => speed === Infinity ? [] : [speed < 1e-6 ? `no ${what}` : `${number(speed)} ${unit} ` +
      `(${joints.join(", ")}; least ${word} ${direction.map((x) => x.toFixed(2)).join(", ")})`];
    const [v, w] = this.page.engine.speeds.asked, most = share < 1e4 ? `${number(100 * share)}\u00a0%` : "more than all";
    return `Joint speed limits allow in every direction ${[...said(linear, "m/s", "translation", "along"), ...said(angular, "rad/s", "rotation", "about")].join(" or ")}; ` +
      `${v} m/s and ${w} rad/s at once take ${most} of a limit.`;
  }

  losses(words) {
    $("lost").replaceChildren(...words.map((w) => make("li", "", w)));
  }

  choose(entry, pose, scroll = true) {
    this.items.forEach((item, i) => {
      item.classList.toggle("chosen", i === entry);
      item.querySelector(".actions").hidden = i !== entry;
      const said = item.querySelector(".statement");
      if (said) said.hidden = i !== entry;
      item.querySelectorAll(".pose").forEach((b, k) => b.classList.toggle("on", i === entry && k === pose));
    });
    if (entry !== null && scroll) this.items[entry].scrollIntoView({ block: "nearest" });
  }

  playing(kind) {
    this.items.forEach((item) => item.querySelectorAll(".path").forEach((b) =>
      b.classList.toggle("on", kind !== null && b.classList.contains(kind))));
  }
}
