// Families of singular configurations: equations, and points on them.
//
// A family is { branches: [{ values: [{ joint, value }], equations }] }, its equations those of `sums.mjs`.

import { leastNorm, norm } from "./linear.mjs";
import { evaluate } from "./sums.mjs";

const ON = 1e-13, TOUCHING = 1e-12, FULL = 2 * Math.PI;

// No zero of the equation is nearer to q than this, Euclidean in its angles; 0 says nothing.
//
// Along any straight line |f''| <= M, so f has no zero before the first root of |f| - |g| s - M s^2 / 2 = 0.
export function lowerBound(equation, q) {
  if (equation.power) return 0;
  const { value, gradient, error } = evaluate(equation, q), f = Math.max(0, Math.abs(value) - error), g = norm(gradient);
  return f && (2 * f) / (g + Math.sqrt(g * g + 2 * equation.curvature * f)) * (1 - 1e-12);
}

// Point of the branch's equations near q, moved along `free` joints, or null: Gauss-Newton with
// steps of least norm.
export function project(equations, q, free, iterations = 60) {
  let best = null, least = Infinity;
  const x = q.slice();
  for (let k = 0; k <= iterations; k++) {
    const found = equations.map((e) => evaluate(e, x));
    const f = found.map((r, i) => r.value / equations[i].size);
    const worst = Math.max(...f.map(Math.abs));
    if (worst < least) { least = worst; best = x.slice(); }
    if (worst <= ON || k === iterations) break;
    const A = found.map((r, i) => free.map((on, j) => (on ? r.gradient[j] / equations[i].size : 0)));
    const step = leastNorm(A, f.map((v) => -v), worst < 1e-10 ? 1e-6 : 1e-10);
    const cut = Math.min(1, 0.7 / Math.max(norm(step), 1e-300));
    for (let j = 0; j < x.length; j++) if (free[j]) x[j] += cut * step[j];
  }
  return least <= TOUCHING ? best : null;
}

// What a joint is away from a value: whole turns aside for a revolute one.
export const apart = (q, value, prismatic) =>
  (prismatic ? q - value : q - value - FULL * Math.round((q - value) / FULL));

// Numbers in [0, 1) that are the same everywhere (mulberry32).
export function generator(seed) {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

// Values of joint j, the others held at q, at which a family is met: ticks beside its slider.
export function meetings(family, q, j, low, high, prismatic) {
  const out = [];
  for (const branch of family.branches) {
    const mine = branch.values.find((v) => v.joint === j);
    if (branch.values.some((v) => v.joint !== j && Math.abs(apart(q[v.joint], v.value, false)) > 1e-7)) continue;
    if (mine && branch.equations.length === 0) {
      const first = prismatic ? 0 : Math.ceil((low - mine.value) / FULL - 1e-9);
      const last = prismatic ? 0 : Math.floor((high - mine.value) / FULL + 1e-9);
      for (let k = first; k <= last; k++) {
        const value = mine.value + k * FULL;
        if (value >= low - 1e-9 && value <= high + 1e-9) out.push(value);
      }
    } else if (!mine && branch.equations.length === 1) out.push(...zerosAlong(branch.equations[0], q, j, low, high));
  }
  return [...new Set(out.map((v) => Math.round(v * 1e9) / 1e9))].sort((a, b) => a - b);
}

// Zeros of an equation as joint j alone goes from low to high: split where the curvature bound
// leaves room, so that none that crosses is passed over.
export function zerosAlong(equation, q, j, low, high) {
  const degree = 2 * Math.max(0, ...equation.rate.map((r) => Math.abs(r[j])), ...(equation.power ?? []).map((p) => p[j]));
  if (!degree) return [];
  const x = q.slice(), at = (v) => { x[j] = v; return evaluate(equation, x).value; };
  const pieces = Math.max(16, Math.ceil(8 * degree * Math.max(1, (high - low) / Math.PI)));
  const out = [], flat = 1e-12 * equation.size;
  let a = low, fa = at(a), zero = Math.abs(fa) <= flat;
  const everywhere = [0.11, 0.37, 0.71, 0.93].every((s) => Math.abs(at(low + s * (high - low))) <= flat);
  if (everywhere) return [];
  if (zero) out.push(a);
  for (let k = 1; k <= pieces; k++) {
    const b = low + ((high - low) * k) / pieces, fb = at(b);
    if (Math.abs(fb) <= flat) out.push(b);
    else if (!zero && fa * fb < 0) out.push(bisect(at, a, b, fa));
    a = b; fa = fb; zero = Math.abs(fb) <= flat;
  }
  return out;
}

function bisect(f, a, b, fa) {
  for (let k = 0; k < 60; k++) {
    const m = (a + b) / 2, fm = f(m);
    if (fm === 0) return m;
    if (fa * fm < 0) b = m;
    else { a = m; fa = fm; }
  }
  return (a + b) / 2;
}

