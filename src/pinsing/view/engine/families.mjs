// Families of singular configurations: equations, points on them, where two meet, where a motion crosses them,
// and their curves over two joints.
//
// A family is { branches: [{ values: [{ joint, value }], equations }] }. An equation holds amplitude, phase (T),
// rate, power (T x n, power null where no joint in it slides), noise, reach, curvature and size as the program's
// `TrigSum`: sum of amplitude prod q^power cos(phase + rate . q). On boxes: how far it can be off its linear part.

import { turnedInto } from "./limits.mjs";
import { generator, newton, norm } from "./linear.mjs";

const known = new WeakMap(), plain = new WeakMap(); // of a branch, of an equation: made once

// Joints that occur in the equations of a branch.
export const jointsOf = ({ equations }) => [...(equations[0]?.rate[0] ?? []).keys()].filter((j) =>
  equations.some((e) => e.rate.some((r) => r[j]) || e.power?.some((p) => p[j])));

// Value and gradient of an equation at q (n), and the error of the value.
export function evaluate(equation, q) {
  if (!plain.has(equation)) plain.set(equation, [sumOf(equation, q.map((_, j) => j), q.map(() => 1)), room(q.length)]);
  const [sum, at] = plain.get(equation);
  sumAt(sum, q, null, at);
  return { value: at.value, gradient: Array.from(at.g), error: at.error };
}

// { joints, sums, at }: the joints that occur, and the equations with joints numbered as in `joints`, in
// weighted coordinates x = w q, in which distances are plain norms.
export function sumsOf(branch, weight) {
  const before = known.get(branch);
  if (before && before.weight.every((w, j) => w === weight[j])) return before;
  const joints = jointsOf(branch);
  const sums = branch.equations.map((e) => sumOf(e, joints, weight)), at = sums.map(() => room(joints.length));
  const made = { joints, sums, at, weight: weight.slice(), terms: sums.reduce((n, s) => n + s.amplitude.length, 0) };
  known.set(branch, made);
  return made;
}

const room = (d) => ({ value: 0, error: 0, rest: 0, size: 0, g: new Float64Array(d), bend: new Float64Array(d) });

function sumOf({ amplitude: sizes, phase, rate: rates, power: powers, noise, reach }, joints, weight) {
  const amplitude = sizes.slice(), rateStart = [0], rateJoint = [], rate = [], powerStart = [0], powerJoint = [], power = [];
  rates.forEach((row, t) => {
    joints.forEach((j, k) => {
      const p = powers ? powers[t][j] : 0;
      if (row[j]) { rateJoint.push(k); rate.push(row[j] / weight[j]); }
      if (p) { powerJoint.push(k); power.push(p); amplitude[t] /= weight[j] ** p; }
    });
    rateStart.push(rate.length);
    powerStart.push(power.length);
  });
  return { amplitude, phase, rateStart, rateJoint, rate, powerStart, powerJoint, power, noise, reach };
}

// A sum at x (d), into `out`; with half-widths h (d), else null, also the rest of its linear part in the box
// and how much each joint adds to that. `error` is that of rounding.
export function sumAt(sum, x, h, out) {
  const { amplitude, phase, rateStart, rateJoint, rate, powerStart, powerJoint, power } = sum, { g, bend } = out;
  let value = 0, rest = 0, size = 0, farthest = 4;
  g.fill(0);
  bend.fill(0);
  for (let t = 0; t < amplitude.length; t++) {
    const r0 = rateStart[t], r1 = rateStart[t + 1], p0 = powerStart[t], p1 = powerStart[t + 1];
    let angle = phase[t], swing = 0;
    for (let k = r0; k < r1; k++) {
      const j = rateJoint[k];
      angle += rate[k] * x[j];
      farthest = Math.max(farthest, Math.abs(x[j]));
      if (h) swing += Math.abs(rate[k]) * h[j];
    }
    const s = Math.sin(angle), c = Math.cos(angle);
    let now = amplitude[t], largest = amplitude[t], magnitude = amplitude[t], first = 0, squares = 0;
    for (let k = p0; k < p1; k++) now *= x[powerJoint[k]] ** power[k];
    value += now * c;
    for (let k = r0; k < r1; k++) g[rateJoint[k]] -= now * s * rate[k];
    for (let k = p0; k < p1; k++) {
      const j = powerJoint[k], half = h ? h[j] : 0, a = Math.max(Math.abs(x[j]) + half, 1e-150);
      let lowered = amplitude[t] * power[k];
      for (let m = p0; m < p1; m++) lowered *= x[powerJoint[m]] ** (m === k ? power[m] - 1 : power[m]);
      g[j] += lowered * c;
      largest *= a ** power[k];
      magnitude *= Math.max(a, 1) ** power[k];
      first += power[k] * (half / a);
      squares += power[k] * (half / a) ** 2;
    }
    size += magnitude;
    if (!h) continue;
    // Second derivatives of p cos are p'' cos - 2 p' sin - p cos, and the angle is within `swing` of its
    // value in the middle, so that |cos| and |sin| are too.
    const even = Math.min(Math.abs(c) + swing, 1), odd = Math.min(Math.abs(s) + swing, 1);
    rest += 0.5 * largest * (even * (swing * swing + Math.max(first * first - squares, 0)) + odd * 2 * swing * first);
    for (let k = r0; k < r1; k++) {
      const j = rateJoint[k];
      bend[j] += largest * Math.abs(rate[k]) * h[j] * (even * swing + odd * first);
    }
    for (let k = p0; k < p1; k++) {
      const j = powerJoint[k], a = Math.max(Math.abs(x[j]) + h[j], 1e-150);
      bend[j] += largest * power[k] * (h[j] / a) * (odd * swing + even * first);
    }
  }
  out.value = value;
  out.size = size;
  out.error = size * (sum.noise + 4.5e-16 * sum.reach * farthest);
  out.rest = rest * (1 + 1e-12) + 2 * out.error;
}

const ON = 1e-13, TOUCHING = 1e-12, FULL = 2 * Math.PI;

// No zero of the equation is nearer to q than this, Euclidean in its angles; 0 says nothing.
//
// Along any straight line |f''| <= M, so f has no zero before the first root of |f| - |g| s - M s^2 / 2 = 0.
export function lowerBound(equation, q) {
  if (equation.power) return 0;
  const { value, gradient, error } = evaluate(equation, q), f = Math.max(0, Math.abs(value) - error), g = norm(gradient);
  return f && (2 * f) / (g + Math.sqrt(g * g + 2 * equation.curvature * f)) * (1 - 1e-12);
}

// Values of equations at q (n) over their sizes, and their slopes by some joints.
export function slopesAt(equations, q, joints) {
  const found = equations.map((e) => evaluate(e, q)), over = (v, i) => v / equations[i].size;
  return { values: found.map((r, i) => over(r.value, i)), rows: found.map((r, i) => joints.map((j) => over(r.gradient[j], i))) };
}

// Point of the branch's equations near q, moved along some joints, or null.
export function project(equations, q, joints, iterations = 60) {
  const { q: x, error } = newton(q.map(() => 1), q, joints, (p) => slopesAt(equations, p, joints), iterations, Infinity, ON);
  return error <= TOUCHING ? x : null;
}

// What a joint is away from a value: whole turns aside for a revolute one.
export const apart = (q, value, prismatic) =>
  (prismatic ? q - value : q - value - FULL * Math.round((q - value) / FULL));

// Values of joint j, the others held at q, at which a family is met: ticks beside its slider.
export function meetings(family, q, j, low, high, prismatic) {
  const [a, b] = [low, high].map((end) => q.map((v, i) => (i === j ? end : v)));
  const out = family.branches.flatMap(({ values, equations }) => {
    const mine = values.find((v) => v.joint === j);
    if (values.some((v) => v !== mine && Math.abs(apart(q[v.joint], v.value, false)) > 1e-7)) return [];
    if (mine) return equations.length ? [] : turnsOf(mine.value, low - 1e-9, high + 1e-9, prismatic);
    return equations.length === 1 ? zerosBetween(equations[0], a, b, 16).map((part) => low + part * (high - low)) : [];
  });
  return [...new Set(out.map((v) => Math.round(v * 1e9) / 1e9))].sort((a, b) => a - b);
}

// What a joint at a value is, by whole turns for a revolute one, within a range.
function turnsOf(value, low, high, prismatic) {
  if (prismatic) return value >= low && value <= high ? [value] : [];
  const first = Math.ceil((low - value) / FULL), last = Math.floor((high - value) / FULL);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => value + (first + k) * FULL);
}

// Families [{ name, at: [...] }] met on the straight ways from each of the `rows` (n each) to the next, and
// where: samples from 0 on, with parts of one. A family of one condition is met where that is zero or changes its
// sign; those of more conditions are met by chance only.
export function crossings(families, rows, joints) {
  return families.filter((family) => family.reachable !== false).flatMap(({ name, branches }) => {
    const single = branches.filter((b) => b.values.length + b.equations.length === 1);
    const at = rows.slice(1).flatMap((b, k) => single.flatMap((branch) => crossed(branch, rows[k], b, joints).map((part) => k + part)));
    return at.length ? [{ name, at: at.sort((x, y) => x - y) }] : [];
  });
}

// Parts of the way from a to b, beyond a, at which a branch of one condition is met.
function crossed({ values: [fixed], equations }, a, b, joints) {
  if (!fixed) return zerosBetween(equations[0], a, b, 1).filter((part) => part > 0);
  const { joint, value } = fixed, [from, to] = [a[joint], b[joint]];
  const passed = turnsOf(value, Math.min(from, to), Math.max(from, to), joints[joint].prismatic);
  return passed.filter((v) => v !== from).map((v) => (v - from) / (to - from));
}

const MOST = 512; // looks on a way

// Zeros of an equation on the straight way from a to b, as parts of it: where the sign changes from one look to the
// next, or it is flat; none where it is so all the way. As many looks as the fastest term needs, a multiple of `least`.
function zerosBetween(equation, a, b, least) {
  const far = a.map((v, j) => Math.abs(b[j] - v)), f = (part) => evaluate(equation, a.map((v, j) => v + part * (b[j] - v))).value;
  const needed = (t, j) => far[j] * (10 * Math.abs(equation.rate[t][j]) + 20 * (equation.power?.[t][j] ?? 0));
  const fast = equation.rate.map((row, t) => row.reduce((sum, _, j) => sum + needed(t, j), 0));
  const looks = Math.min(MOST, least * Math.ceil(Math.max(...fast) / least));
  if (!looks) return [];
  const values = Array.from({ length: looks + 1 }, (_, k) => f(k / looks));
  const zero = values.map((v) => Math.abs(v) <= 1e-12 * equation.size);
  if (zero.every(Boolean)) return [];
  return values.flatMap((v, k) => {
    if (zero[k]) return [k / looks];
    return k && !zero[k - 1] && values[k - 1] * v < 0 ? [bisect(f, (k - 1) / looks, k / looks, values[k - 1])] : [];
  });
}

// Zero of f between a and b, where its sign changes; fa is f(a).
function bisect(f, a, b, fa, steps = 60) {
  for (let k = 0; k < steps; k++) {
    const m = (a + b) / 2, fm = f(m);
    if (fm === 0) return m;
    if (fa < 0 !== fm < 0) b = m;
    else { a = m; fa = fm; }
  }
  return (a + b) / 2;
}

const SAME = 1e-3, SLACK = 1e-9;

// Up to `count` configurations within the limits that are on both families, those near `start` first;
// [] where none is found.
export function meetingPoses(data, one, two, start, count = 3, tries = 20) {
  const random = generator(31), found = [];
  const span = data.joints.map((joint) => joint.span);
  const draw = () => span.map(([low, high]) => low + random() * (high - low)), far = (a, b) => farFrom(a, b, data);
  const branches = one.branches.flatMap((a) => two.branches.flatMap((b) => { const both = merged(a, b, data.joints); return both ? [both] : []; }));
  for (let k = 0; k < tries; k++) for (const branch of branches) {
    const q = placed(branch, k ? draw() : start, data.joints, span);
    const free = jointsOf(branch).filter((j) => !branch.values.some((v) => v.joint === j));
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

// What counts as a radian, for each joint.
export const unitsOf = ({ joints, task }) => joints.map((joint) => (joint.prismatic ? task.lengthScale : 1));

// Distance of configurations x and q, whole turns aside, radians and length scales.
export const farFrom = (x, q, data) =>
  norm(unitsOf(data).map((unit, j) => apart(q[j], x[j], data.joints[j].prismatic) / unit));

// The first, and others unlike those already chosen.
function spread(found, count, far) {
  const out = found.slice(0, 1);
  while (out.length < Math.min(count, found.length)) {
    const gap = (x) => Math.min(...out.map((y) => far(x, y)));
    out.push(found.filter((x) => !out.includes(x)).reduce((a, b) => (gap(b) > gap(a) ? b : a)));
  }
  return out;
}

const BISECTED = 16; // times, a side of half a square

// The branch of a family that q is nearest to by its joint values, with the joints of its equation;
// null where none has a single equation in two joints or more.
export function curveBranch(family, q, joints) {
  let best = null, least = Infinity;
  for (const branch of family.branches) {
    if (branch.equations.length !== 1) continue;
    const involved = jointsOf(branch);
    const off = branch.values.reduce((sum, v) => sum + Math.abs(apart(q[v.joint], v.value, joints[v.joint].prismatic)), 0);
    if (involved.length >= 2 && off < least) { least = off; best = { equation: branch.equations[0], involved, values: branch.values }; }
  }
  return best;
}

// Segments [[a, b], [c, d]] of the curve over joint i in `across` and joint j in `up`, each [from, to]:
// halves of the squares of a grid whose corners differ in sign.
export function locus(equation, q, i, j, across, up, steps = 72) {
  const x = q.slice(), at = (u, v) => { x[i] = u; x[j] = v; return evaluate(equation, x).value; };
  const place = ([from, to], k) => from + ((to - from) * k) / steps;
  const grid = [...Array(steps + 1).keys()].map((a) =>
    [...Array(steps + 1).keys()].map((b) => at(place(across, a), place(up, b))));
  const out = [];
  for (let a = 0; a < steps; a++) for (let b = 0; b < steps; b++) for (const third of [[a + 1, b], [a, b + 1]]) {
    const corners = [[a, b], third, [a + 1, b + 1]], ends = [];
    corners.forEach(([c, d], k) => {
      const [e, f] = corners[(k + 1) % 3], one = grid[c][d];
      if (one < 0 === grid[e][f] < 0) return;
      const on = (t) => [place(across, c + t * (e - c)), place(up, d + t * (f - d))];
      ends.push(on(bisect((t) => at(...on(t)), 0, 1, one, BISECTED)));
    });
    if (ends.length) out.push(ends);
  }
  return out;
}
