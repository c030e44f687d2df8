// Curves of closed configurations with one input free: pseudo-arclength continuation in the space of all
// joints, so that a curve runs through type 2 singularities, where the moving input turns back. Singular
// points: minima along curves, refined to numerical exactness.
//
// The measures have a kink at zero, so what is refined is, with the loops closed, a singular value with the
// sign that its vectors give it: of the closure over the output's rows, over the inputs, or alone.

import { add, CLOSED, combined, dot, newton, nullVector, scaled, subtract, svd, transpose, worst } from "./linear.mjs";
import { closure, everyJoint, gapOf, kindOf, motions, output, unitRows, wrap } from "./mechanism.mjs";

export const STEP = 0.04; // largest step, radians or length scales
const MOST = 4000, WORTH = 0.3, STEPS = 24, SAME = 1e-6, REACH = 0.6, DIFFERENCE = 1e-5;
const MEASURE = { "type 1": "one", "type 2": "two", constraint: "constraint" };

// The curve through a closed `start`, input `moving` (its place among the inputs) free: { closed, ways: [ahead, behind] },
// each points [{ q, t (unit tangent), one, two, constraint }] from the start on; null where none begins.
//
// It ends at a limit of the moving input, or where it closes; then both ways are all of it, and the next point again.
export function trace(data, start, moving) {
  const curve = curveOf(data, moving), q = correct(curve, start), ahead = q && run(curve, q, null);
  const behind = ahead?.closed ? ahead : ahead && run(curve, q, scaled(ahead.points[0].t, -1));
  if (!behind) return null;
  const measured = (p) => { const { one, two, constraint } = motions(data, p.q); return { ...p, one, two, constraint }; };
  const points = ahead.points.map(measured);
  if (!ahead.closed) return { closed: false, ways: [points, behind.points.map((p) => measured({ q: p.q, t: scaled(p.t, -1) }))] };
  const round = subtract(points.at(-1).q, q), back = points.map((p) => ({ ...p, q: subtract(p.q, round) })).reverse();
  const next = { ...points[1], q: add(points[1].q, round) }, last = { ...back[1], q: subtract(back[1].q, round) };
  return { closed: true, ways: [[...points, next], [...back, last]] };
}

function curveOf(data, moving) {
  const index = data.actuated[moving], { prismatic, lower, upper } = data.joints[index];
  const low = lower ?? -Infinity, high = upper ?? Infinity, bounded = prismatic || high - low < 2 * Math.PI - 1e-9;
  const held = unitRows(data, data.actuated.filter((j) => j !== index));
  return { data, index, held, low: bounded ? low : -Infinity, high: bounded ? high : Infinity };
}

function tangent({ data, index, held }, q, along) {
  const t = nullVector([...closure(data, q).G, ...held]);
  return (along ? dot(t, along) : t[index]) >= 0 ? t : scaled(t, -1);
}

export const moved = (data, q, step) => q.map((v, j) => v + step[j] * data.metric[j]);

// Nearest closed configuration with the same held inputs, across the tangent; null if there is none.
export function correct({ data, held }, guess, along = null) {
  const rest = along ? [...held, along] : held, still = rest.map(() => 0);
  const system = (q) => { const { residual, G } = closure(data, q); return { values: [...residual, ...still], rows: [...G, ...rest] }; };
  const { q, error } = newton(data.metric, guess, everyJoint(data), system, 20, 1);
  return error <= CLOSED ? q : null;
}

// Points from `start` on, and whether the curve came back to it; null where it has no end.
function run(curve, start, along) {
  const { data, index, low, high } = curve;
  let q = start, t = tangent(curve, start, along), step = STEP, travelled = 0;
  const first = t, points = [{ q, t }];
  while (points.length < MOST) {
    const next = correct(curve, moved(data, q, scaled(t, step)), t);
    const turn = next ? tangent(curve, next, t) : scaled(t, -1), bend = dot(turn, t);
    // The next tangent must be close: a sharp bend wants smaller steps.
    if (bend < 0.98 && step > 1e-4) { step /= 2; continue; }
    if (bend < 0.5) return { points, closed: false };
    travelled += step;
    if (travelled > 2 * STEP && back(data, start, first, q, t, step)) {
      points.push({ q: add(next, wrap(data, subtract(start, next))), t: first });
      return { points, closed: true };
    }
    if (next[index] < low || next[index] > high) return { points, closed: false };
    q = next;
    t = turn;
    points.push({ q, t });
    step = Math.min(STEP, 1.5 * step);
  }
  return null;
}

// Whether the step from q leads over the start, in the same direction.
function back(data, start, first, q, t, step) {
  const gap = wrap(data, subtract(start, q)).map((v, j) => v / data.metric[j]), along = dot(gap, t);
  return along >= 0 && along <= step && worst(subtract(gap, scaled(t, along))) <= step / 4 && dot(first, t) > 0.5;
}

// Singular point { kind, q, converged } of a kind near q, the joints `held` kept.
export function refinePoint(data, start, kind, held = []) {
  const { rtol } = data.judge, used = everyJoint(data).filter((j) => !held.includes(j));
  const { q: found } = newton(data.metric, start, used, (x) => vanishing(data, x, kind, used), STEPS, REACH);
  const q = wrap(data, found), measures = motions(data, q);
  const converged = worst(closure(data, q).residual) <= rtol && measures[MEASURE[kind]] <= rtol;
  return { kind: converged ? kindOf(measures, rtol) : kind, q, converged };
}

// What is zero at a singular point, and its slopes by the joints `used`: the residual of the loops, and u M w
// of the left vector u of the singular value that vanishes and each right vector w of it or of none. They
// change as u dM w: what u and w turn by is of second order.
function vanishing(data, q, kind, used) {
  const { constraint, output: outputs } = data.ranks, { residual, G } = closure(data, q);
  const place = { "type 1": constraint + outputs, "type 2": q.length, constraint }[kind] - 1;
  const { sigma, left, right } = svd(transpose(matrixOf(data, q, kind)));
  const pushed = (j, step) => combined(matrixOf(data, q.map((v, i) => (i === j ? v + step * data.metric[j] : v)), kind), right[place]);
  const changes = used.map((j) => scaled(subtract(pushed(j, DIFFERENCE), pushed(j, -DIFFERENCE)), 0.5 / DIFFERENCE));
  const still = left.slice(place);
  return {
    values: [...residual, ...still.map((_, k) => (k ? 0 : sigma[place]))],
    rows: [...G.map((row) => used.map((j) => row[j])), ...still.map((w) => changes.map((change) => dot(change, w)))],
  };
}

// The matrix that loses rank: of the closure, with the output at rest (type 1), or the inputs (type 2).
function matrixOf(data, q, kind) {
  const { G, places } = closure(data, q);
  if (kind === "constraint") return G;
  return [...G, ...(kind === "type 1" ? output(data, places) : unitRows(data, data.actuated))];
}

// All singular points { kind, q, rangeEnd } along points of a curve of input k, refined; each once, in the turns of
// the point that it was found from. `rangeEnd`: the input turns back there.
export function singularAlong(data, k, points) {
  const held = data.actuated.filter((_, i) => i !== k), found = [];
  for (const [kind, start, rangeEnd] of candidates(points, data.actuated[k])) {
    const { q, ...point } = refinePoint(data, start, kind, held);
    if (!point.converged || gapOf(data, q, start) > 6 * STEP) continue;
    const made = { ...point, q: add(start, wrap(data, subtract(q, start))), rangeEnd };
    const same = found.findIndex((other) => gapOf(data, q, other.q) <= SAME);
    if (same < 0) found.push(made);
    else if (rangeEnd && point.kind === found[same].kind) found[same] = made;
  }
  return found;
}

// [kind, q, whether the input turns back]: where it does, and the minima of the measures.
function candidates(points, index) {
  const out = points.filter(({ t }, k) => k && points[k - 1].t[index] * t[index] <= 0).map(({ q }) => ["type 2", q, true]);
  for (const [kind, name] of Object.entries(MEASURE)) {
    const value = (k) => points[k]?.[name] ?? Infinity, low = points.map((_, k) => value(k) <= Math.min(value(k - 1), value(k + 1), WORTH));
    if (points.length > 2 && !low.every(Boolean)) low.forEach((is, k) => { if (is) out.push([kind, points[k].q, false]); });
  }
  // At a constraint singularity the others are met as well, and less exactly: it goes first.
  return out.sort((a, b) => (b[0] === "constraint") - (a[0] === "constraint"));
}
