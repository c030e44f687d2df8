// The side panel: all text goes in as text nodes, never as markup.

const $ = (id) => document.getElementById(id);

// An element, its class or all that is set of it, and what it holds: words, or other elements.
function make(tag, given = "", ...content) {
  const node = document.createElement(tag);
  if (given) Object.assign(node, typeof given === "string" ? { className: given } : given);
  node.append(...content);
  return node;
}

// A button and what it does.
const press = (className, title, onclick, ...content) => make("button", { className, title, onclick }, ...content);

// Something on the band of a slider, from one percentage of its length to another, or at one.
const onBand = (className, from, to = null, title = "") =>
  make("span", { className, title, style: `left: ${from}%; ${to === null ? "" : `width: ${to - from}%`}` });

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
  if (value === Infinity) return "\u221e";
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size < 1e-3 || size >= 1e5 ? value.toExponential(1) : String(Number(value.toPrecision(3)));
}

const many = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

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

// What is read at an arm: where it goes, label and title.
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
const ARROWS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1 };

class Panel {
  constructor(app) {
    const { page } = app, { notes, entries, coverage } = page;
    Object.assign(this, { app, page, listed: app.joints });
    $("robot").textContent = page.robot.name;
    this.head();
    this.keys();
    $("numbers").replaceChildren(...this.numbers().map(([id, label, title]) =>
      make("div", "", make("dt", { title }, label), make("dd", { id }))));
    $("scale").textContent = this.scale();
    const own = this.ownScale(), [singular, postures] = ["entries", "postures"].map((list) => entries.filter((entry) => entry.list === list).length);
    if (own) $("numbers").after(make("p", "note own-scale", own));
    $("count").textContent = singular ? `(${singular})` : "";
    $("postures-count").textContent = `(${postures})`;
    // An empty list says itself that there are no others.
    $("coverage").textContent = singular ? coverage ?? "" : (coverage ?? "").replace("Proven: there are no others.", "Proven.");
    $("coverage").hidden = !coverage;
    $("coverage").classList.toggle("warning", Boolean(coverage?.startsWith("NOT")));
    const warns = (note) => note.startsWith("WARNING");
    $("notes").append(...notes.map((note) => make("li", warns(note) ? "warning" : "", note)));
    Object.assign($("notes-box"), { hidden: !notes.length, open: notes.some(warns) });
    this.items = entries.map((entry, index) => this.entry(entry, index));
    if (!singular) $("entries").append(make("li", "note", this.noEntries()));
    this.joints();
    this.choose(null, 0);
  }

  head() {
    const { robot: { base, tip, task, lengthScale } } = this.page;
    $("chain").title = "base, tip, task, and the length scale L that translations are divided by";
    $("chain").textContent = `${base} \u2192 ${tip} \u00b7 ${many(this.listed.length, "joint")} \u00b7 ${task} task \u00b7 L\u00a0=\u00a0${lengthScale}\u00a0m`;
  }

  numbers() { return ARM_NUMBERS; }

  // The verdict and its ratio do not hang on the user's length scale; the other numbers do.
  ownScale() {
    const { judge: { columns, length }, task } = this.app.engine, sliding = columns?.some((c) => c !== 1);
    if (!columns || length === task.lengthScale && !sliding) return "";
    return `Verdict, \u03c3min/\u03c3max and what is nearly lost: at the arm\u2019s own length of ${number(length)} m` +
      `${sliding ? " (joints that slide are scaled by it too)" : ""}; the other numbers: at L = ${number(task.lengthScale)} m.`;
  }

  scale() {
    const { translation, rotation, thickness } = this.page.settings;
    return `Ellipsoids at unit joint speed: 1 m/s is drawn ${number(translation)} m long, ` +
      `1 rad/s ${number(rotation)} m. What is flat is drawn up to ${number(1000 * thickness)} mm thick, to be seen.`;
  }

  // Whether pure motions are drawn, and not all.
  get pure() { return this.app.view.options.mode === "pure"; }

  keys() {
    const { options: { mode }, frame } = this.app.view, words = this.pure ? ["translation with orientation held", "rotation with the tip held"]
      : ["tip velocity, whatever the rotation", "angular velocity, whatever the translation"];
    ["translation", "rotation"].forEach((kind, k) => {
      const key = $(`key-${kind}`), drawn = frame ? thickened(frame.ellipsoids[mode][kind], this.page.settings[kind]) : "";
      key.textContent = words[k] + (drawn && `: ${drawn}`);
      key.title = drawn ? "Drawn thicker than it is, to be seen" : "";
    });
  }

  // A line of the list, with what can be done with it.
  entry(entry, index) {
    const { list, name, poses, titles, solved } = entry, { app } = this, row = make("div", "actions");
    const text = make("span", "text", make("b", "", name), formula(make("span"), entry.text));
    const button = press("entry", entry.reason, () => app.choose(index, 0), text, formula(make("span", "more"), entry.more.join(" \u00b7 ")));
    button.disabled = !poses;
    for (let k = 0; poses > 1 && k < poses; k++) {
      row.append(press("pose", titles?.[k] ?? `Pose ${k + 1} of ${name}`, () => app.choose(index, k), k ? k + 1 : "pose 1"));
    }
    for (const [kind, { button: words, title }] of Object.entries(PATHS)) {
      if (entry[kind]) row.append(press(`path ${kind}`, title, () => app.playOrPause(kind), words));
    }
    const item = make("li", poses ? "" : "away", button, row, ...(solved?.length ? [statement(solved)] : []));
    $(list).append(item);
    $(`${list}-box`).hidden = false;
    return item;
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
      const has = family !== null && Engine.curveBranch(family, q, this.listed);
      this.drawn = has ? { entry, locus: new Locus(this.app, family, q) } : null;
      if (has) this.items[entry].append(this.drawn.locus.node);
    } else this.drawn.locus.draw(q);
  }

  nearestWords(words) { $("nearest-pose").textContent = words; }

  joints() {
    this.rows = this.listed.map((joint, index) => {
      const found = this.row(index, true);
      found.row.classList.add("named");
      found.name.replaceChildren(formula(make("b"), joint.symbol), make("small", "", joint.label));
      found.value.after(make("small", "limits", this.limits(joint)));
      $("joints").append(found.row);
      return found;
    });
    $("joints-note").textContent = this.app.engine.families.length ? "Ticks: where this joint alone meets a family." : "";
    if (this.page.zones) $("joints-note").append(` Red: ${this.page.zones.why}.`);
  }

  limits(joint) {
    if (joint.lower === null || joint.upper === null) return "no limits";
    // As many digits as they need, at most two, and one of large values.
    const { unit, size } = unitOf(joint), [low, high] = joint.span.map((v) => Number((v / size).toFixed(Math.abs(v / size) < 100 ? 2 : 1)) + 0);
    return low === high ? `cannot move: ${low}${unit}` : `${low} \u2026 ${high}${unit}`;
  }

  // Where each slider alone would meet a family.
  ticks(marks, zones) {
    this.rows.forEach(({ band }, i) => {
      const [low, high] = this.listed[i].span, part = (value) => (100 * (value - low)) / (high - low);
      const inside = (zones[i] ?? []).map(([a, b]) => onBand("zone", part(a), part(b)));
      band.replaceChildren(...inside, ...marks[i].map(({ value, name, text }) => onBand("mark", part(value), null, `${name}: ${text}`)));
    });
  }

  // A slider with the joint's name and value, both to be moved; a fixed one only follows.
  row(index, moves) {
    const joint = this.listed[index], [min, max] = joint.span, { unit, said, size, end } = unitOf(joint);
    const name = formula(make("span", "name"), joint.symbol), value = make("span", "value");
    const slider = make("input", { type: "range", min, max, step: "any", disabled: !moves, ariaLabel: joint.name });
    const band = make("span", "band"), track = moves ? make("span", "track", slider, band) : slider;
    const row = make("div", { className: "joint", title: joint.name }, name, track, value);
    if (!moves) return { row, slider, name, value };
    const moved = () => this.app.move(index, Number(slider.value));
    const typed = make("input", { className: "typed", type: "text", inputMode: "decimal", autocomplete: "off", ariaLabel: `${joint.name}, ${said}` });
    value.append(typed, unit);
    slider.addEventListener("input", moved);
    typed.addEventListener("change", () => {
      const text = typed.value.replace(",", ".").replace("\u2212", "-").replace(end, "").trim(), given = Number(text) * size;
      const wrong = !NUMBER.test(text) || Math.abs(given) > HUGE;
      if (!wrong) slider.value = given;
      this.app.typed(index, wrong ? null : given, typed.value);
    });
    row.addEventListener("keydown", (event) => {
      const up = ARROWS[event.key];
      if (!up || event.ctrlKey || event.altKey || event.metaKey || event.target === typed && !/Up|Down/.test(event.key)) return;
      event.preventDefault();
      slider.value = Number(slider.value) + up * size * (event.shiftKey ? 0.1 : 1); // it keeps to its ends
      moved();
    });
    return { row, slider, name, value, typed, band };
  }

  show(frame, dragged = -1) {
    this.keys();
    this.verdict(frame);
    this.readings(frame);
    $("why").textContent = frame.why.length ? `${frame.status === "singular" ? "because" : "near where"} ${frame.why.join("; ")}` : "";
    $("remarks").textContent = frame.notes.join("; ");
    const beyond = this.listed.filter((joint) => frame.outside.includes(joint.name));
    $("outside").hidden = !beyond.length;
    $("outside").textContent = beyond.length ? `outside the limits: ${beyond.map((joint) => `${joint.name} (${this.limits(joint)})`).join(", ")}` : "";
    this.rows.forEach(({ row, slider, value, typed }, i) => {
      const joint = this.listed[i], shown = this.value(frame, i), { unit, size, digits } = unitOf(joint);
      row.classList.toggle("hot", frame.hot.includes(i));
      row.classList.toggle("beyond", beyond.includes(joint));
      if (i !== dragged) slider.value = shown;
      const text = (shown / size).toFixed(digits).replace(/^-(0\.0+)$/, "$1");
      if (typed) typed.value = text;
      else value.textContent = text + unit;
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
    formula($("nearest"), frame.verdict?.text ?? "");
  }

  readings(frame) {
    const { mixed, always, sigma, rank, genericRank, lost, speeds } = frame, zero = frame.status === "singular";
    const found = { ...frame, "sigma-min": sigma[genericRank - 1] };
    for (const [id] of ARM_NUMBERS) $(id).textContent = number(found[id]);
    $("bars").replaceChildren(...sigma.slice(0, genericRank).map((s, i) => {
      const none = zero && i >= rank, bar = make("div", none ? "zero" : "", make("span", "", none ? "0" : number(Number(s.toPrecision(2)))));
      bar.style.height = `${(100 * s) / sigma[0]}%`;
      return bar;
    }));
    $("speeds").textContent = speeds ? this.speeds(speeds) : "";
    this.losses([...lost.map((m) => m.words), ...(mixed
      ? [`(${mixed} of these ${lost.length} ${mixed === 1 ? "is" : "are"} missing at every configuration: the arm reaches rank ` +
         `${genericRank} in a task of ${this.app.engine.task.rows.length} rows)`] : [])]);
    $("always").hidden = !always.length;
    $("always").textContent = `${many(always.length, "motion")} ${always.length === 1 ? "is" : "are"} missing at every configuration; here: ${always.join("; ")}`;
  }

  speeds({ linear, angular, share }) {
    const said = ({ speed, joints, direction }, unit, what, word) => speed === Infinity ? [] : [speed < 1e-6 ? `no ${what}` : `${number(speed)} ${unit} ` +
      `(${joints.join(", ")}; least ${word} ${direction.map((x) => x.toFixed(2)).join(", ")})`];
    const [v, w] = this.app.engine.speeds.asked, most = share < 1e4 ? `${number(100 * share)}\u00a0%` : "more than all";
    return `Joint speed limits allow in every direction ${[...said(linear, "m/s", "translation", "along"), ...said(angular, "rad/s", "rotation", "about")].join(" or ")}; ` +
      `${v} m/s and ${w} rad/s at once take ${most} of a limit.`;
  }

  losses(words) { $("lost").replaceChildren(...words.map((w) => make("li", "", w))); }

  choose(entry, pose, scroll = true) {
    this.items.forEach((item, i) => {
      item.classList.toggle("chosen", i === entry);
      for (const part of item.querySelectorAll(".actions, .statement")) part.hidden = i !== entry;
      item.querySelectorAll(".pose").forEach((b, k) => b.classList.toggle("on", i === entry && k === pose));
    });
    if (entry !== null && scroll) this.items[entry].scrollIntoView({ block: "nearest" });
  }

  // The button of what is playing, an entry's of a kind.
  playing(kind) { for (const b of document.querySelectorAll("#panel .path")) b.classList.toggle("on", b.classList.contains(kind)); }
}
