// Poses where two families meet; often, not always, the arm loses more there than on either of them.

import { apart, generator, project } from "./families.mjs";
import { spanOf, turnedInto } from "./limits.mjs";
import { norm } from "./linear.mjs";
import { freeOf } from "./sums.mjs";

const SAME = 1e-3, SLACK = 1e-9;

// Up to `count` configurations within the limits that are on both families, those near `start` first;
// [] where none is found.
export function meetingPoses(data, one, two, start, count = 3, tries = 20) {
  const random = generator(31), found = [];
  const span = data.joints.map((joint) => spanOf(joint, data.task.lengthScale));
  const draw = () => span.map(([low, high]) => low + random() * (high - low));
  const branches = one.branches.flatMap((a) => two.branches.flatMap((b) => { const both = merged(a, b, data.joints); return both ? [both] : []; }));
  for (let k = 0; k < tries; k++) for (const branch of branches) {
    const q = placed(branch, k ? draw() : start, data.joints, span);
    const free = freeOf(branch, q.length).map((on, j) => on && !branch.values.some((v) => v.joint === j));
    const point = branch.equations.length ? project(branch.equations, q, free) : q;
    if (!point) continue;
    const inside = folded(point, data.joints, span);
    if (!inside.every((v, j) => v >= span[j][0] - SLACK && v <= span[j][1] + SLACK)) continue;
    if (found.every((x) => apartFrom(x, inside, data.joints) > SAME)) found.push(inside);
  }
  return spread(found.sort((a, b) => apartFrom(a, start, data.joints) - apartFrom(b, start, data.joints)), data.joints, count);
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

const apartFrom = (a, b, joints) => norm(a.map((v, j) => apart(v, b[j], joints[j].prismatic)));

// The first, and others unlike those already chosen.
function spread(found, joints, count) {
  const out = found.slice(0, 1);
  while (out.length < Math.min(count, found.length)) {
    const gap = (x) => Math.min(...out.map((y) => apartFrom(x, y, joints)));
    out.push(found.filter((x) => !out.includes(x)).reduce((a, b) => (gap(b) > gap(a) ? b : a)));
  }
  return out;
}
