// Curves of closed configurations with one input free: pseudo-arclength continuation in the space of all
// joints, so that a curve runs through type 2 singularities, where the moving input turns back.

import { add, dot, scaled, subtract } from "./linear.mjs";
import { CLOSED, closure, newton, worst, wrap } from "./loops.mjs";
import { motions } from "./mechanism.mjs";
import { nullVector } from "./orthogonal.mjs";

export const STEP = 0.04; // largest step, radians or length scales
const MOST = 4000;

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
  return { moving, closed: ahead.closed, points: points.map((p) => ({ ...p, ...measures(data, p.q) })) };
}

function measures(data, q) {
  const { one, two, constraint } = motions(data, q);
  return { one, two, constraint };
}

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
