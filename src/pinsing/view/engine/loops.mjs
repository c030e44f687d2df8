// Closed loops of a mechanism: residual, constraint Jacobian, and Newton's way to close them.
//
// `data` is the "engine" part of a mechanism's page: { chain (its tip is the output), loops:
// [{ kind, a, b }] of frames { parent, R, t }, task: { rows, lengthScale }, metric (what counts as one
// radian, per joint), joints, actuated, ranks: { constraint, mobility, output }, judge, home, assembly,
// balls, elbows, legs, normal, sizes }. Everything below is without units: lengths over the length scale.

import { frameOf, jacobian, placements } from "./chain.mjs";
import { generator } from "./families.mjs";
import { leastNorm, product, rotationVector, scaled, subtract, times, transpose } from "./linear.mjs";

export const CLOSED = 1e-11; // a residual up to this counts as closed
const ROWS = { planar: 2, "3d": 3, "6d": 6 }, FULL = 2 * Math.PI;

// Residual (k) and constraint Jacobian G (k x n) at q (n). Rows of a loop are in the axes of its first
// frame, translations before rotations. `columns`: Jacobian of a frame.
export function closure(data, q, columns = jacobian) {
  const places = placements(data.chain, q), L = data.task.lengthScale, residual = [], G = [];
  for (const { kind, a, b } of data.loops) {
    const A = frameOf(a, places), B = frameOf(b, places), inA = transpose(A.R);
    const Ja = columns(data.chain, places, a), Jb = columns(data.chain, places, b);
    const gap = scaled(times(inA, subtract(B.t, A.t)), 1 / L);
    if (kind === "6d") gap.push(...rotationVector(product(inA, B.R)));
    for (let i = 0; i < ROWS[kind]; i++) {
      const part = i < 3 ? 0 : 3, axis = inA[i - part], unit = i < 3 ? 1 / L : 1;
      residual.push(gap[i]);
      G.push(data.metric.map((m, j) => {
        let sum = 0;
        for (let k = 0; k < 3; k++) sum += axis[k] * (Jb[part + k][j] - Ja[part + k][j]);
        return unit * m * sum;
      }));
    }
  }
  return { residual, G, places };
}

export const worst = (values) => values.reduce((most, v) => Math.max(most, Math.abs(v)), 0);

// Task rows of the output (m x n) by all joints, and its placement.
export function output(data, q, columns = jacobian) {
  const places = placements(data.chain, q), full = columns(data.chain, places, data.chain.tip);
  const J = data.task.rows.map((r) => full[r].map((x, j) => x * data.metric[j] * (r < 3 ? 1 / data.task.lengthScale : 1)));
  return { J, place: frameOf(data.chain.tip, places), places };
}

// Revolute values, or differences of such, within half a turn of zero.
export const wrap = (data, q) =>
  q.map((v, j) => (data.joints[j].prismatic ? v : v - FULL * Math.floor((v + Math.PI) / FULL)));

// Greatest difference of two configurations, whole turns aside, radians and metres.
export const gapOf = (data, a, b) => worst(wrap(data, subtract(a, b)));

export const passiveOf = (data) => data.joints.map((_, j) => !data.actuated.includes(j));
export const everyJoint = (data) => data.joints.map(() => true);

// Close the loops by moving the `free` joints (mask) least: { q, error }.
export function gaussNewton(data, start, free) {
  const used = free.flatMap((on, j) => (on ? [j] : []));
  const system = (q) => { const { residual, G } = closure(data, q); return { values: residual, rows: G.map((row) => used.map((j) => row[j])) }; };
  return newton(data, start, used, system, 60);
}

// Newton's method by the joints `used`, none further than `reach` from the start: the best { q, error } of what
// `system(q)` says is to vanish, { values, rows (slopes by these joints) }.
//
// Steps are cut at half a radian: far from closure Newton's own would jump between assembly modes.
export function newton(data, start, used, system, steps, reach = Infinity) {
  let q = start.slice(), kept = q, best = Infinity;
  for (let k = 0; k <= steps; k++) {
    const { values, rows } = system(q), size = worst(values);
    if (size >= best && best <= CLOSED) break;
    if (size < best) { best = size; kept = q; }
    if (size <= 1e-15) break;
    const step = leastNorm(rows, values.map((v) => -v), 1e-11), longest = worst(step), cut = longest > 0.5 ? 0.5 / longest : 1;
    q = q.slice();
    used.forEach((j, i) => { q[j] += cut * step[i] * data.metric[j]; });
    if (!q.every(Number.isFinite) || worst(subtract(q, start).map((v, j) => v / data.metric[j])) > reach) break;
  }
  return { q: kept, error: best };
}

// Closed configurations that random starts lead to; joints that are not `free` stay at `start`.
export function randomClosed(data, count, seed, free = everyJoint(data), start = data.home) {
  const random = generator(seed), out = [];
  for (let k = 0; k < count; k++) {
    const drawn = data.joints.map(({ prismatic }) => (2 * random() - 1) * (prismatic ? data.task.lengthScale : Math.PI));
    const { q, error } = gaussNewton(data, start.map((v, j) => (free[j] ? drawn[j] : v)), free);
    if (error <= CLOSED) out.push(wrap(data, q));
  }
  return out;
}
