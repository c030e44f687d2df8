// Families that a motion crosses between its samples, which no sample tells.

import { evaluate } from "./sums.mjs";

const STEP = 0.05, MOST = 64, FULL = 2 * Math.PI; // radians, or length scales, between two looks

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
  const looks = Math.min(MOST, Math.max(1, Math.ceil(far / STEP)));
  const valueAt = (part) => evaluate(equation, a.map((v, j) => v + part * (b[j] - v))).value, out = [];
  let before = valueAt(0);
  for (let i = 1; i <= looks; i++) {
    const now = valueAt(i / looks);
    if (before * now < 0) {
      let [low, high] = [(i - 1) / looks, i / looks];
      for (let k = 0; k < 50; k++) { const middle = (low + high) / 2; if (valueAt(middle) * now > 0) high = middle; else low = middle; }
      out.push(high);
    }
    before = now;
  }
  return out;
}
