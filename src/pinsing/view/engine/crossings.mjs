// Families that a motion crosses between its samples, which no sample tells.

import { evaluate } from "./families.mjs";

const STEP = 0.05, MOST = 64, FULL = 2 * Math.PI; // radians, or length scales, between two looks

// Families [{ name, after, count }] crossed on the straight ways from each of the `rows` (n each) to the
// next: the first sample after which, from 0, and how often. A family of one condition is crossed where
// that changes its sign; those of more conditions are met by chance only.
export function crossings(families, rows, joints, lengthScale) {
  const out = [];
  for (const family of families) {
    const found = family.reachable === false ? [] : family.branches.flatMap((branch) => crossedBy(branch, rows, joints, lengthScale));
    if (found.length) out.push({ name: family.name, after: Math.min(...found), count: found.length });
  }
  return out;
}

function crossedBy({ values, equations }, rows, joints, lengthScale) {
  if (values.length + equations.length !== 1) return [];
  const [fixed] = values, out = [];
  for (let k = 1; k < rows.length; k++) {
    const a = rows[k - 1], b = rows[k];
    const times = fixed ? passed(a[fixed.joint] - fixed.value, b[fixed.joint] - fixed.value, joints[fixed.joint].prismatic)
      : changes(equations[0], a, b, joints, lengthScale);
    for (let n = 0; n < times; n++) out.push(k - 1);
  }
  return out;
}

// How many whole turns (a slider: zero) lie strictly between two offsets.
function passed(a, b, prismatic) {
  if (prismatic) return a * b < 0 ? 1 : 0;
  const [low, high] = [Math.min(a, b) / FULL, Math.max(a, b) / FULL];
  return Math.max(0, Math.ceil(high) - Math.floor(low) - 1);
}

function changes(equation, a, b, joints, lengthScale) {
  const far = Math.max(...a.map((v, j) => Math.abs(b[j] - v) / (joints[j].prismatic ? lengthScale : 1)));
  const looks = Math.min(MOST, Math.max(1, Math.ceil(far / STEP)));
  let before = evaluate(equation, a).value, count = 0;
  for (let i = 1; i <= looks; i++) {
    const now = evaluate(equation, a.map((v, j) => v + (i / looks) * (b[j] - v))).value;
    if (before * now < 0) count += 1;
    before = now;
  }
  return count;
}

// The same in words; "" where nothing is crossed.
export function crossingWords(found) {
  const one = ({ name, after, count }) => `${name} between samples ${after + 1} and ${after + 2}` +
    (count > 1 ? ` (and ${count - 1} more time${count > 2 ? "s" : ""})` : "");
  return found.length ? `joints moving straight between samples, it crosses ${found.map(one).join(", ")}` : "";
}
