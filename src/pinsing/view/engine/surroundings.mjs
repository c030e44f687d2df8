// What surrounds a pose of a mechanism: how far each input can go, and the other modes.

import { trace, STEP } from "./curve.mjs";
import { outside, valueText } from "./limits.mjs";
import { add, scaled, subtract } from "./linear.mjs";
import { gapOf, passiveOf, randomClosed, worst, wrap } from "./loops.mjs";
import { assemblySign, modeOf, modeOrder, motions } from "./mechanism.mjs";
import { AT_TYPE_2 } from "./pose_drive.mjs";
import { singularAlong } from "./singular_points.mjs";
import { workingByLegs } from "./working_modes.mjs";

const FULL = 2 * Math.PI, SAME = 1e-4, HERE = 1e-7, STARTS = 48;
const DISTINCT = 1e-5; // at type 2 two modes are one, of which CLOSED leaves 3e-6

// How far input k can go from a closed q before the assembly mode ends, the others held: { lower, upper,
// whole, points }; at a type 2 singularity both of the modes that meet there count. Null where no curve
// is found.
export function stretch(data, q, k) {
  const index = data.actuated[k], { prismatic, lower: least, upper: most } = data.joints[index];
  const found = trace(data, q, k);
  if (!found) return null;
  let { points } = found, here = 0;
  points.forEach((p, i) => { if (gapOf(data, p.q, q) < gapOf(data, points[here].q, q)) here = i; });
  const count = points.length;
  if (found.closed) {
    here += count - 1;
    points = threeTimes(points);
  }
  const value = points.map((p) => p.q[index] + q[index] - points[here].q[index]);
  const slope = points.map((p) => p.t[index]);
  const last = found.closed ? Math.min(here + count - 1, slope.length - 1) : count - 1;
  const first = Math.max(here - count + 1, 0), atEnd = motions(data, q).two <= AT_TYPE_2;
  let [end, turns] = untilTurn(slope, here, last, 1, atEnd);
  let [begin] = untilTurn(slope, here, first, -1, atEnd);
  const whole = found.closed && !turns;
  if (whole) [begin, end] = [here, last];
  const mode = atEnd ? "0" : assemblySign(data, q);
  const part = points.slice(Math.max(begin - 1, 0), end + 2);
  const seen = value.slice(begin, end + 1), low = Math.min(...seen), high = Math.max(...seen);
  const centre = whole ? q[index] : (low + high) / 2;
  const marks = singularAlong(data, { moving: k, closed: false, points: part })
    .filter((p) => "0?".includes(mode) || [mode, "0"].includes(assemblySign(data, p.q)))
    .map((p) => ({ ...p, q: p.q.map((v, j) => (j === index && !prismatic ? v + FULL * Math.round((centre - v) / FULL) : v)) }))
    .sort((a, b) => a.q[index] - b.q[index]);
  if (whole) return { lower: centre - Math.PI, upper: centre + Math.PI, whole, points: marks };
  // Between samples the input still goes a little further, to where it turns back.
  const ends = marks.filter((p) => p.rangeEnd).map((p) => p.q[index]);
  const lower = Math.min(low, ...ends), upper = Math.max(high, ...ends);
  // The last step before a limit ends short of it.
  const near = STEP * data.metric[index];
  const snapped = (v, limit) => (limit !== null && !ends.includes(v) && Math.abs(v - limit) <= near ? limit : v);
  return { lower: snapped(lower, least), upper: snapped(upper, most), whole, points: marks };
}

// A closed curve, with a round more before and after it.
function threeTimes(points) {
  const last = points.length - 1, turn = subtract(points[last].q, points[0].q), round = points.slice(0, last);
  const shifted = (some, turns) => some.map((p) => ({ ...p, q: add(p.q, scaled(turn, turns)) }));
  return [...shifted(round, -1), ...round, ...shifted(points, 1)];
}

// Place, from `start` on, just beyond where the slope changes sign; and whether it does.
function untilTurn(slope, start, last, step, atEnd) {
  if (start === last) return [start, false];
  // At a turning point itself the sign is that of the way ahead.
  const begin = atEnd ? start + step : start, sign = Math.sign(slope[begin]);
  for (let k = begin + step; step > 0 ? k <= last : k >= last; k += step) if (Math.sign(slope[k]) !== sign) return [k, true];
  return [last, false];
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
