// The equations of one branch on boxes: values, gradients, and how far each can be off its linear part.
//
// In weighted coordinates x = w q, in which distances are plain norms, an equation is
// sum of amplitude prod x^power cos(phase + rate . x).

import { freeOf } from "./families.mjs";

const EPS = 2.3e-16;
const known = new WeakMap(); // of a branch, made once

// { joints, sums, at }: the joints that occur, and the equations with joints numbered as in `joints`.
export function sumsOf(branch, weight) {
  const before = known.get(branch);
  if (before && before.weight.every((w, j) => w === weight[j])) return before;
  const joints = freeOf(branch, weight.length).flatMap((on, j) => (on ? [j] : []));
  const sums = branch.equations.map((e) => sumOf(e, joints, weight)), d = joints.length;
  const at = sums.map(() => ({ value: 0, error: 0, rest: 0, size: 0, g: new Float64Array(d), bend: new Float64Array(d) }));
  const made = { joints, sums, at, weight: weight.slice(), terms: sums.reduce((n, s) => n + s.amplitude.length, 0) };
  known.set(branch, made);
  return made;
}

function sumOf(e, joints, weight) {
  const terms = e.cos.length, rateStart = [0], rateJoint = [], rate = [], powerStart = [0], powerJoint = [], power = [];
  const amplitude = new Float64Array(terms), phase = new Float64Array(terms);
  let reach = 0;
  for (let t = 0; t < terms; t++) {
    let size = Math.hypot(e.cos[t], e.sin[t]), turned = Math.atan2(-e.sin[t], e.cos[t]), total = 0;
    joints.forEach((j, k) => {
      const half = 0.5 * e.frequencies[t][j], p = e.powers ? e.powers[t][j] : 0;
      turned += half * e.shift[j];
      if (half) { rateJoint.push(k); rate.push(half / weight[j]); total += Math.abs(half / weight[j]); }
      if (p) { powerJoint.push(k); power.push(p); size /= weight[j] ** p; }
    });
    amplitude[t] = size;
    phase[t] = turned;
    reach = Math.max(reach, total);
    rateStart.push(rate.length);
    powerStart.push(power.length);
  }
  return { amplitude, phase, rateStart, rateJoint, rate: Float64Array.from(rate), powerStart, powerJoint, power,
           noise: Math.max(e.accuracy ?? 0, 1e-15) + EPS * (2 * terms + 16), reach: reach + 1 };
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
