// Equations of families: values, gradients, and on boxes how far they can be off their linear part.
//
// An equation holds amplitude, phase (T), rate, power (T x n, power null where no joint in it slides), noise,
// reach, curvature and size as the program's `TrigSum`: sum of amplitude prod q^power cos(phase + rate . q).

const known = new WeakMap(), plain = new WeakMap(); // of a branch, of an equation: made once

// Joints (mask) that occur in the equations of a branch.
export const freeOf = ({ equations }, n) => Array.from({ length: n }, (_, j) =>
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
  const joints = freeOf(branch, weight.length).flatMap((on, j) => (on ? [j] : []));
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
