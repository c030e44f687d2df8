// The nearest singular configuration within the limits that is found, with what is certain.

import { measure } from "./measured.mjs";
import { distance, farFrom } from "./distance.mjs";
import { project } from "./families.mjs";
import { outside, turnedInto } from "./limits.mjs";
import { freeOf } from "./sums.mjs";

const SLACK = 1e-9, ROUNDS = 4, LISTED = 12, LOOK = 200000; // LOOK: terms of each family

// { q, value, least } or null: `q` is singular and within the limits, at `value`; no family is nearer
// than `least`. Beside points of the families near q, poses that are known (`listed`) are tried.
export function nearestSingular(data, q, listed = []) {
  const { joints, task } = data, tried = [];
  let least = Infinity;
  for (const family of data.families) {
    if (family.reachable === false) continue;
    const found = distance(data, family, q, LOOK);
    least = Math.min(least, found.lower);
    if (found.q) tried.push(settled(data, family.branches[found.branch], found.q));
  }
  const far = (x) => farFrom(x, q, joints, task.lengthScale);
  tried.push(...listed.slice().sort((a, b) => far(a) - far(b)).slice(0, LISTED));
  const good = tried.filter((x) => x && !outside(data, x).length && singularAt(data, x)).map((x) => ({ q: x, value: far(x), least }));
  return good.length ? good.reduce((a, b) => (b.value < a.value ? b : a)) : null;
}

const ends = ({ lower, upper }) => [lower ?? -Infinity, upper ?? Infinity];

// Also where only the rounding of the file keeps it from being singular.
const singularAt = (data, q) => measure(data, q).status === "singular" ||
  (data.nominal !== null && data.nominal !== undefined && measure({ ...data, chain: data.nominal }, q).status === "singular");

// A point of the branch within the limits: whole turns first, then joints at their limits are held.
function settled({ joints }, branch, start) {
  let q = start.map((v, j) => turnedInto(ends(joints[j]), v, joints[j].prismatic));
  const free = freeOf(branch, q.length);
  for (let round = 0; round < ROUNDS; round++) {
    const beyond = joints.map((joint, j) => {
      const [low, high] = ends(joint);
      return q[j] < low - SLACK ? low : q[j] > high + SLACK ? high : null;
    });
    if (beyond.every((end) => end === null)) return q;
    if (beyond.some((end, j) => end !== null && branch.values.some((v) => v.joint === j))) return null;
    q = q.map((v, j) => beyond[j] ?? v);
    beyond.forEach((end, j) => { if (end !== null) free[j] = false; });
    if (!branch.equations.length) continue;
    q = project(branch.equations, q, free);
    if (!q) return null;
  }
  return null;
}
