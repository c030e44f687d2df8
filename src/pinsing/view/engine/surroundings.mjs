// What surrounds a pose of a mechanism: how far each input can go, the other modes, the clearest pose; and inputs
// that are given: within their limits, and one after the other as a file has them.

import { endsOf, isOutside, outside, turnedInto, valueText } from "./limits.mjs";
import { CLOSED, generator, scaled, subtract, worst } from "./linear.mjs";
import { assemblySign, closure, gapOf, gaussNewton, modeOf, modeOrder, motions, passiveOf, randomClosed, wrap } from "./mechanism.mjs";
import { AT_TYPE_2, driven, heldPose, placeOf, poseGap, poseOf, stopWords } from "./pose_drive.mjs";
import { singularAlong, STEP, trace } from "./singular_points.mjs";

const FULL = 2 * Math.PI, SAME = 1e-4, HERE = 1e-7, STARTS = 48;
const DISTINCT = 1e-5; // at type 2 two modes are one, of which CLOSED leaves 3e-6

// How far input k can go from a closed q before the assembly mode ends, the others held: { lower, upper,
// whole, points }; at a type 2 singularity both of the modes that meet there count. Null where no curve
// is found.
export function stretch(data, q, k) {
  const index = data.actuated[k], { lower: least, upper: most } = data.joints[index], curve = trace(data, q, k);
  if (!curve) return null;
  const atEnd = motions(data, q).two <= AT_TYPE_2, [ahead, behind] = curve.ways.map((way) => toTurn(curve, way, index, atEnd));
  const whole = curve.closed && !ahead.turns, mode = atEnd ? "0" : assemblySign(data, q);
  const seen = [...(whole ? [] : behind.points.slice(1).reverse()), ...ahead.points];
  const part = [...(whole ? behind.points.slice(1, 2) : behind.more), ...seen, ...ahead.more];
  const points = singularAlong(data, k, part).filter((p) => "0?".includes(mode) || [mode, "0"].includes(assemblySign(data, p.q)));
  if (whole) for (const p of points) p.q[index] -= FULL * Math.round((p.q[index] - q[index]) / FULL);
  points.sort((a, b) => a.q[index] - b.q[index]);
  if (whole) return { lower: q[index] - Math.PI, upper: q[index] + Math.PI, whole, points };
  // Between samples the input still goes a little further, to where it turns back.
  const ends = points.filter((p) => p.rangeEnd).map((p) => p.q[index]), values = [...seen.map((p) => p.q[index]), ...ends];
  const lower = Math.min(...values), upper = Math.max(...values);
  // The last step before a limit ends short of it.
  const near = STEP * data.metric[index];
  const snapped = (v, limit) => (limit !== null && !ends.includes(v) && Math.abs(v - limit) <= near ? limit : v);
  return { lower: snapped(lower, least), upper: snapped(upper, most), whole, points };
}

// Points of a way along a curve up to just beyond where the input turns back, whether it does, and the next
// point, if any.
function toTurn({ closed }, way, index, atEnd) {
  // At a turning point itself the sign is that of the way ahead.
  const first = atEnd ? 1 : 0, end = way.findIndex(({ t }, n) => n > first && Math.sign(t[index]) !== Math.sign(way[first].t[index]));
  const last = end < 0 ? way.length - (closed ? 2 : 1) : end;
  return { points: way.slice(0, last + 1), turns: end >= 0, more: way.slice(last + 1, last + 2) };
}

// A value of input k in words, degrees or millimetres.
export const inputText = (data, k, value, digits = 1) => valueText(data.joints[data.actuated[k]].prismatic, value, digits);

// The singular pose that the least move of one input leads to, among stretches of all inputs:
// { q, kind, text }, null if there is none, or q is one.
export function aheadOf(data, q, stretches) {
  let best = null;
  for (const [k, found] of stretches.entries()) for (const point of found ? found.points : []) {
    const index = data.actuated[k], gap = point.q[index] - q[index], size = Math.abs(gap) / data.metric[index];
    if (size <= HERE) return null;
    if (best && size >= best.size) continue;
    const text = `${point.kind} is nearest: ${data.joints[index].name} ${gap > 0 ? "+" : "\u2212"} ${inputText(data, k, Math.abs(gap))}`;
    best = { size, q: point.q, kind: point.kind, text };
  }
  return best;
}

// Modes [{ name, q, here }]: all ways within the limits to close the loops at these inputs (`assemblies`), and to
// reach this output (`working`), those of one name numbered; the present one is among them.
export function modesAt(data, q) {
  return { assemblies: named(data, q, assembliesAt(data, q)), working: named(data, q, workingByLegs(data, q), inputsText) };
}

function assembliesAt(data, q) {
  let found = [];
  for (const other of randomClosed(data, STARTS, 811, passiveOf(data), q)) {
    if (found.every((x) => gapOf(data, x, other) > DISTINCT)) found.push(other);
  }
  if (found.length > STARTS / 2) return []; // the loops can move with these inputs at rest: no modes to choose
  found = found.filter((x) => !outside(data, x).length);
  const order = found.map((x) => [modeOrder(data, x), x.map((v) => Math.round(v * 1e6))].flat());
  const before = (a, b) => { const k = order[a].findIndex((v, i) => v !== order[b][i]); return k < 0 ? 0 : order[a][k] - order[b][k]; };
  return found.map((_, i) => i).sort(before).map((i) => found[i]);
}

const inputsText = (data, q) => data.actuated.map((j, k) => `${data.joints[j].name} ${inputText(data, k, q[j], 0)}`).join(", ");

function named(data, q, found, more = null) {
  const away = found.map((x) => worst(wrap(data, subtract(x, q))));
  let here = away.indexOf(Math.min(...away)), all = found;
  if (here < 0 || away[here] > SAME) { all = [q, ...found]; here = 0; }
  const names = all.map((x, i) => modeOf(data, i === here ? q : x));
  return all.map((x, i) => {
    const same = names.filter((n) => n === names[i]).length;
    const which = () => (more ? `: ${more(data, x)}` : ` (${names.slice(0, i + 1).filter((n) => n === names[i]).length})`);
    const name = same === 1 ? names[i] : `${names[i]}${which()}`;
    return { name, q: i === here ? q : x, here: i === here };
  });
}

const POSES = 40, MODES = 256, LOOSE = 1e-6;

// Configurations within the limits that a number of starts led to; flipped passive joints are one. Where the
// coordinates led leave the pose open (a Delta's platform may be twisted), each pose has its own.
export function workingByLegs(data, q) {
  const random = generator(947), goal = poseOf(data, placeOf(data, q)), poses = [];
  const spans = data.joints.map((joint) => joint.span);
  const take = (x) => {
    const { R, t } = placeOf(data, x), mark = [...R.flat(), ...scaled(t, 1 / data.task.lengthScale)];
    let pose = poses.find((one) => worst(subtract(one.mark, mark)) <= SAME);
    if (!pose) poses.push(pose = { mark, at: x, legs: data.legs.map((joints) => ({ joints, found: [] })) });
    for (const { joints, found } of pose.legs) {
      const driven = joints.filter((j) => data.actuated.includes(j));
      const gap = (other) => worst(wrap(data, subtract(x, other)).filter((_, j) => driven.includes(j)));
      if (!joints.some((j) => isOutside(data.joints[j], x[j])) && found.every((other) => gap(other) > SAME)) found.push(x);
    }
  };
  take(q);
  for (let k = 0; k < POSES; k++) {
    const drawn = spans.map(([low, high]) => low + random() * (high - low));
    const { q: x, error } = heldPose(data, goal, drawn);
    if (error <= CLOSED) take(wrap(data, x));
  }
  const together = poses.flatMap(({ at, legs }) => legs.reduce((all, { joints, found }) =>
    all.flatMap((x) => found.map((y) => x.map((v, j) => (joints.includes(j) ? y[j] : v)))).slice(0, MODES), [at]));
  return together.filter((x) => worst(closure(data, x).residual) <= LOOSE)
    .map((x) => wrap(data, gaussNewton(data, x).q)).filter((x) => poseGap(data, x, q) <= LOOSE && sameOutput(data, x, q));
}

// Rows of the output that are not led, as they depend on others, agree as well.
function sameOutput(data, x, q) {
  const [a, b] = [x, q].map((one) => placeOf(data, one)), { rows, lengthScale } = data.task;
  return rows.every((r) => r > 2 || Math.abs(a.t[r] - b.t[r]) <= LOOSE * lengthScale) &&
    (![3, 4, 5].every((r) => rows.includes(r)) || worst(subtract(a.R.flat(), b.R.flat())) <= LOOSE);
}

const INSIDE = 1e-9;

// Inputs driven from a closed q as far as they go, within the limits of their joints: { q, said }, in words what
// is not reached, and why; "" where all is.
export function inputsLed(data, inputs, q) {
  const { actuated, joints, metric } = data, text = (k, value, digits) => inputText(data, k, value, digits);
  const wanted = inputs.map((v, k) => {
    const [low, high] = endsOf(joints[actuated[k]]);
    return Math.min(high, Math.max(low, v));
  });
  const beyond = inputs.flatMap((v, k) => Math.abs(v - wanted[k]) <= INSIDE * metric[actuated[k]] ? []
    : [`${joints[actuated[k]].name} = ${text(k, v)} is beyond its limit, ${text(k, wanted[k])}`]).join("; ");
  const { q: there, reached, stop } = driven(data, wanted, q), away = wanted.map((v, k) => Math.abs(v - q[actuated[k]]));
  if (reached === 1) return { q: there, said: beyond && `${beyond}; the mechanism stays there.` };
  const k = away.indexOf(Math.max(...away)), { name } = joints[actuated[k]], why = stopWords(data, stop);
  const said = stop.why === "far" ? `refused: the value of ${joints[stop.joint].name} is too large; ${why}. The mechanism stays where it was.`
    : `infeasible: ${name} = ${text(k, wanted[k])}. In this mode the loops close up to ${text(k, there[actuated[k]], 2)}, ` +
      `the others held (${why}); the mechanism stays there.`;
  return { q: there, said: `${beyond && `${beyond}. `}${said}` };
}

// Rows of inputs followed from a closed q, as far as it goes: { path: configurations, row, said }: the row that
// ended it, and why.
export function followInputs(data, q, rows) {
  const path = [];
  for (const [row, inputs] of rows.entries()) {
    const { q: there, said } = inputsLed(data, inputs, path.at(-1) ?? q);
    if (said) return { path, row, said };
    path.push(there);
  }
  return { path, row: -1, said: "" };
}

const CLIMBED = 3, FIRST = 0.4, LAST = 0.01, AROUND = [0.05, 0.2, 0.5];

// How well a pose is away from all singularities: its smallest measure; 0 where it is outside limits.
export function healthOf(data, q) {
  if (worst(closure(data, q).residual) > CLOSED) return 0;
  const { one, two, constraint } = motions(data, q);
  return outside(data, q).length ? 0 : Math.min(one, two, constraint);
}

// The pose { q, measure } whose smallest measure is largest, of `tries` at random and those given: home,
// poses around it, and poses anywhere within the limits; the best of them are climbed from. q is null
// where none within the limits is regular.
export function healthiestPose(data, given = [], tries = 160, steps = 60) {
  const random = generator(23), spans = data.joints.map((joint) => joint.span);
  const drawn = () => spans.map(([low, high]) => low + (high - low) * random());
  const around = (q, size) => q.map((v, j) => v + size * data.metric[j] * (2 * random() - 1));
  const found = [];
  const tried = (start) => {
    const { q: closed, error } = gaussNewton(data, start);
    const q = closed.map((v, j) => turnedInto(spans[j], v, data.joints[j].prismatic)), measure = error <= CLOSED ? healthOf(data, q) : 0;
    if (measure > 0) found.push({ q, measure });
    return measure;
  };
  [data.home, ...given].forEach(tried);
  for (let k = 0; k < tries; k++) tried(k % 2 ? around(data.home, AROUND[k % AROUND.length]) : drawn());
  const best = found.sort((a, b) => b.measure - a.measure).slice(0, CLIMBED);
  for (const start of best) {
    let top = start;
    for (let size = FIRST, k = 0; k < steps && size > LAST; k++) {
      const count = found.length;
      tried(around(top.q, size / Math.sqrt(top.q.length)));
      const now = found.length > count ? found[found.length - 1] : null;
      if (now && now.measure > top.measure) { top = now; size = Math.min(FIRST, 1.5 * size); } else size *= 0.85;
    }
  }
  return found.reduce((a, b) => (b.measure > a.measure ? b : a), { q: null, measure: 0 });
}
