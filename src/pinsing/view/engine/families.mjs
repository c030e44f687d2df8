// Families of singular configurations: equations, points on them, where two meet and where a motion crosses them.
//
// A family is { branches: [{ values: [{ joint, value }], equations }] }, its equations those of `sums.mjs`.

import { spanOf, turnedInto } from "./limits.mjs";
import { leastNorm, norm } from "./linear.mjs";
import { evaluate, freeOf } from "./sums.mjs";

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

// Zero of f between a and b, where its sign changes; fa is f(a).
export function bisect(f, a, b, fa, steps = 60) {
  for (let k = 0; k < steps; k++) {
    const m = (a + b) / 2, fm = f(m);
    if (fm === 0) return m;
    if (fa * fm < 0) b = m;
    else { a = m; fa = fm; }
  }
  return (a + b) / 2;
}

const LOOK = 0.05, MOST = 64; // radians, or length scales, between two looks; the most of them on a way

// Families [{ name, at: [...] }] crossed on the straight ways from each of the `rows` (n each) to the next, and
// where: samples from 0 on, with parts of one. A family of one condition is crossed where that changes its
// sign; those of more conditions are met by chance only.
export function crossings(families, rows, joints, lengthScale) {
  const out = [];
  for (const family of families) {
    const found = family.reachable === false ? [] : family.branches.flatMap((branch) => crossedBy(branch, rows, joints, lengthScale));
    if (found.length) out.push({ name: family.name, at: found.sort((a, b) => a - b) });
  }
  return out;
}

function crossedBy({ values, equations }, rows, joints, lengthScale) {
  if (values.length + equations.length !== 1) return [];
  const [fixed] = values, out = [];
  for (let k = 1; k < rows.length; k++) {
    const a = rows[k - 1], b = rows[k];
    const parts = fixed ? passed(a[fixed.joint] - fixed.value, b[fixed.joint] - fixed.value, joints[fixed.joint].prismatic)
      : changes(equations[0], a, b, joints, lengthScale);
    out.push(...parts.map((part) => k - 1 + part));
  }
  return out;
}

// Where whole turns (a slider: zero) lie strictly between two offsets.
function passed(a, b, prismatic) {
  const [low, high] = [Math.min(a, b) / FULL, Math.max(a, b) / FULL], out = [];
  if (prismatic) return a * b < 0 ? [a / (a - b)] : [];
  for (let turn = Math.floor(low) + 1; turn < high; turn++) out.push((turn * FULL - a) / (b - a));
  return out;
}

function changes(equation, a, b, joints, lengthScale) {
  const far = Math.max(...a.map((v, j) => Math.abs(b[j] - v) / (joints[j].prismatic ? lengthScale : 1)));
  const looks = Math.min(MOST, Math.max(1, Math.ceil(far / LOOK)));
  const valueAt = (part) => evaluate(equation, a.map((v, j) => v + part * (b[j] - v))).value, out = [];
  let before = valueAt(0);
  for (let i = 1; i <= looks; i++) {
    const now = valueAt(i / looks);
    if (before * now < 0) out.push(bisect(valueAt, (i - 1) / looks, i / looks, before));
    before = now;
  }
  return out;
}

const SAME = 1e-3, SLACK = 1e-9;

// Up to `count` configurations within the limits that are on both families, those near `start` first;
// [] where none is found.
export function meetingPoses(data, one, two, start, count = 3, tries = 20) {
  const random = generator(31), found = [];
  const span = data.joints.map((joint) => spanOf(joint, data.task.lengthScale));
  const draw = () => span.map(([low, high]) => low + random() * (high - low)), far = (a, b) => farFrom(a, b, data.joints, data.task.lengthScale);
  const branches = one.branches.flatMap((a) => two.branches.flatMap((b) => { const both = merged(a, b, data.joints); return both ? [both] : []; }));
  for (let k = 0; k < tries; k++) for (const branch of branches) {
    const q = placed(branch, k ? draw() : start, data.joints, span);
    const free = freeOf(branch, q.length).map((on, j) => on && !branch.values.some((v) => v.joint === j));
    const point = branch.equations.length ? project(branch.equations, q, free) : q;
    if (!point) continue;
    const inside = folded(point, data.joints, span);
    if (!inside.every((v, j) => v >= span[j][0] - SLACK && v <= span[j][1] + SLACK)) continue;
    if (found.every((x) => far(x, inside) > SAME)) found.push(inside);
  }
  return spread(found.sort((a, b) => far(a, start) - far(b, start)), count, far);
}

// What both branches ask for; null where their values contradict each other.
function merged(a, b, joints) {
  const values = a.values.slice();
  for (const v of b.values) {
    const same = values.find((x) => x.joint === v.joint);
    if (!same) values.push(v);
    else if (Math.abs(apart(same.value, v.value, joints[v.joint].prismatic)) > 1e-7) return null;
  }
  return { values, equations: [...a.equations, ...b.equations] };
}

function placed(branch, q, joints, span) {
  const out = q.slice();
  for (const { joint, value } of branch.values) out[joint] = value;
  return folded(out, joints, span);
}

// Moved by whole turns into the limits where that can be.
const folded = (q, joints, span) => q.map((v, j) => turnedInto(span[j], v, joints[j].prismatic));

// Distance of configurations x and q, whole turns aside, radians and length scales.
export const farFrom = (x, q, joints, lengthScale) =>
  Math.hypot(...x.map((v, j) => apart(q[j], v, joints[j].prismatic) / (joints[j].prismatic ? lengthScale : 1)));

// The first, and others unlike those already chosen.
function spread(found, count, far) {
  const out = found.slice(0, 1);
  while (out.length < Math.min(count, found.length)) {
    const gap = (x) => Math.min(...out.map((y) => far(x, y)));
    out.push(found.filter((x) => !out.includes(x)).reduce((a, b) => (gap(b) > gap(a) ? b : a)));
  }
  return out;
}
