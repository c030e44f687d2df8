// Curves of closed configurations with one input free: pseudo-arclength continuation in the space of all
// joints, so that a curve runs through type 2 singularities, where the moving input turns back. Singular
// points: minima along curves, refined to numerical exactness.
//
// The measures have a kink at zero, so what is refined is a smooth system: the loops closed, all inputs
// but one held, and unit velocities Z with G Z = 0 and J Z = 0 (type 1), S Z = 0 (type 2), or one motion
// more than the mobility (constraint).

import { add, dot, leastSquares, norm, nullVector, scaled, subtract, svd, transpose } from "./linear.mjs";
import { CLOSED, closure, gapOf, newton, output, worst, wrap } from "./loops.mjs";
import { kindOf, motions } from "./mechanism.mjs";

export const STEP = 0.04; // largest step, radians or length scales
const MOST = 4000, WORTH = 0.3, STEPS = 40, SAME = 1e-6;
const MEASURE = { "type 1": "one", "type 2": "two", constraint: "constraint" };

// Points [{ q, t (unit tangent), one, two, constraint }] of the curve through a closed `start`, input
// `moving` (its place among the inputs) free, and whether it is closed; null where none begins.
//
// It ends where it closes, or at a limit of the moving input; then it is followed to the other side too.
export function trace(data, start, moving) {
  const curve = curveOf(data, moving), q = correct(curve, start);
  if (!q) return null;
  const ahead = run(curve, q, null);
  if (!ahead) return null;
  let { points } = ahead;
  if (!ahead.closed) {
    const behind = run(curve, q, scaled(points[0].t, -1));
    if (!behind) return null;
    points = [...behind.points.slice(1).reverse().map((p) => ({ q: p.q, t: scaled(p.t, -1) })), ...points];
  }
  return { moving, closed: ahead.closed, points: points.map((p) => {
    const { one, two, constraint } = motions(data, p.q);
    return { ...p, one, two, constraint };
  }) };
}

// The place of the point nearest to q.
export const placeOn = (data, points, q) =>
  points.reduce((best, p, i) => (gapOf(data, p.q, q) < gapOf(data, points[best].q, q) ? i : best), 0);

function curveOf(data, moving) {
  const index = data.actuated[moving], { prismatic, lower, upper } = data.joints[index];
  const low = lower ?? -Infinity, high = upper ?? Infinity, bounded = prismatic || high - low < 2 * Math.PI - 1e-9;
  const held = data.actuated.filter((j) => j !== index).map((j) => data.joints.map((_, i) => (i === j ? 1 : 0)));
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
  const { q, error } = newton(data, guess, guess.map((_, j) => j), system, 20, 1);
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

// Singular point { kind, q, moving, converged, rangeEnd } of a kind near q, the joints `held` kept.
export function refinePoint(data, start, kind, held = []) {
  const { rtol } = data.judge, q = wrap(data, solved(systemOf(data, start, kind, held), start));
  const found = motions(data, q), converged = worst(closure(data, q).residual) <= rtol && found[MEASURE[kind]] <= rtol;
  const free = data.actuated.filter((j) => !held.includes(j)), alone = free.length === 1;
  return {
    kind: converged ? kindOf(found, rtol) : kind, q, converged,
    moving: alone ? data.actuated.indexOf(free[0]) : -1,
    rangeEnd: alone && kind === "type 2" && turnsBack(data, q, free[0], held),
  };
}

// All singular points along a curve, refined; each once.
export function singularAlong(data, curve) {
  const index = data.actuated[curve.moving], held = data.actuated.filter((j) => j !== index), found = [];
  for (const [kind, k] of candidates(curve, index)) {
    const start = curve.points[k].q, point = refinePoint(data, start, kind, held);
    if (!point.converged || gapOf(data, point.q, start) > 6 * STEP) continue;
    const same = found.findIndex((other) => gapOf(data, point.q, other.q) <= SAME);
    if (same < 0) found.push(point);
    else if (point.rangeEnd && !found[same].rangeEnd && point.kind === found[same].kind) found[same] = point;
  }
  return found;
}

// [kind, place on the curve]: where the moving input turns back, and the minima of the measures.
function candidates({ points, closed }, index) {
  const out = [], last = points.length - 1;
  for (let k = 1; k <= last; k++) if (points[k - 1].t[index] * points[k].t[index] <= 0) out.push(["type 2", k]);
  for (const [kind, name] of Object.entries(MEASURE)) {
    if (points.length < 3) continue;
    const value = (k) => points[k][name];
    const left = (k) => (k > 0 ? value(k - 1) : closed ? value(last - 1) : Infinity);
    const right = (k) => (k < last ? value(k + 1) : closed ? value(1) : Infinity);
    const low = points.map((_, k) => value(k) <= left(k) && value(k) <= right(k) && value(k) < WORTH);
    if (!low.every(Boolean)) low.forEach((is, k) => { if (is) out.push([kind, k]); });
  }
  // At a constraint singularity the others are met as well, and less exactly: it goes first.
  return [...out.filter(([kind]) => kind === "constraint"), ...out.filter(([kind]) => kind !== "constraint")];
}

function systemOf(data, q, kind, held) {
  const x0 = q.map((v, j) => v / data.metric[j]);
  return { data, kind, held, n: q.length, anchor: held.map((j) => x0[j]),
           extra: kind === "constraint" ? data.ranks.mobility + 1 : 1 };
}

// Closure error, constraint Jacobian, and the matrix whose null space is asked for.
function matrix({ data, kind }, x) {
  const q = x.map((v, j) => v * data.metric[j]), { residual, G } = closure(data, q);
  if (kind === "type 1") return { residual, G, M: [...G, ...output(data, q).J] };
  if (kind === "type 2") return { residual, G, M: [...G, ...data.actuated.map((j) => x.map((_, i) => (i === j ? 1 : 0)))] };
  return { residual, G, M: G };
}

const pairs = (d) => Array.from({ length: d }, (_, a) => Array.from({ length: d - a }, (_, k) => [a, a + k])).flat();
// M Z, row by row, Z given by its columns.
const through = (M, Z) => M.flatMap((row) => Z.map((z) => row.reduce((sum, v, i) => sum + v * z[i], 0)));

function residualOf(system, x, Z) {
  const { residual, M } = matrix(system, x);
  const unit = pairs(system.extra).map(([a, b]) => Z[a].reduce((sum, v, i) => sum + v * Z[b][i], a === b ? -1 : 0));
  return [...residual, ...through(M, Z), ...unit, ...system.held.map((j, k) => x[j] - system.anchor[k])];
}

// Exact but for the derivative of the Jacobians, which is a central difference. Unknowns: x, then Z
// column by column.
function slopes(system, x, Z) {
  const { n, extra: d, held } = system, { G, M } = matrix(system, x), step = 1e-5;
  const changes = x.map((_, j) => {
    const side = (s) => matrix(system, x.map((v, i) => (i === j ? v + s * step : v))).M;
    const ahead = side(1), behind = side(-1);
    return through(ahead.map((row, r) => subtract(row, behind[r])), Z).map((v) => v / (2 * step));
  });
  const zeros = (k) => new Array(k).fill(0), rows = G.map((row) => [...row, ...zeros(n * d)]);
  M.forEach((row, r) => {
    for (let c = 0; c < d; c++) {
      rows.push([...changes.map((column) => column[r * d + c]), ...zeros(c * n), ...row, ...zeros((d - 1 - c) * n)]);
    }
  });
  for (const [a, b] of pairs(d)) {
    const row = zeros(n + n * d);
    for (let i = 0; i < n; i++) { row[n + a * n + i] += Z[b][i]; row[n + b * n + i] += Z[a][i]; }
    rows.push(row);
  }
  for (const j of held) rows.push(zeros(n + n * d).map((_, i) => (i === j ? 1 : 0)));
  return rows;
}

// Damped Newton steps of least length: the system may have dependent or spare equations.
function solved(system, start) {
  const { data, n, extra } = system;
  let x = start.map((v, j) => v / data.metric[j]);
  let Z = svd(transpose(matrix(system, x).M)).left.slice(-extra);
  let value = residualOf(system, x, Z), size = norm(value), stalled = 0;
  for (let k = 0; k < STEPS && size > 1e-15 && stalled < 2; k++) {
    const step = leastSquares(slopes(system, x, Z), scaled(value, -1), 1e-9);
    let factor = Math.min(1, 0.3 / Math.max(worst(step), 1e-300)), better = null;
    for (let half = 0; half < 6 && !better; half++, factor /= 3) {
      const x1 = x.map((v, j) => v + factor * step[j]);
      const Z1 = Z.map((z, c) => z.map((v, j) => v + factor * step[n + c * n + j]));
      const value1 = residualOf(system, x1, Z1), size1 = norm(value1);
      if (size1 < size) better = { x1, Z1, value1, size1 };
    }
    if (!better) break;
    // A minimum that is not zero is approached slowly: it is no singularity.
    stalled = better.size1 > 0.9 * size ? stalled + 1 : 0;
    ({ x1: x, Z1: Z, value1: value, size1: size } = better);
  }
  return x.map((v, j) => v * data.metric[j]);
}

// Whether the input has an extremum on its curve: steps to both sides move it the same way.
function turnsBack(data, q, index, held) {
  const rows = held.map((j) => q.map((_, i) => (i === j ? 1 : 0)));
  const t = nullVector([...closure(data, q).G, ...rows]);
  const sides = [1, -1].map((sign) => {
    const x = correct({ data, held: rows }, moved(data, q, scaled(t, sign * 1e-3)), t);
    return x ? x[index] - q[index] : 0;
  });
  return sides[0] * sides[1] > 0;
}
