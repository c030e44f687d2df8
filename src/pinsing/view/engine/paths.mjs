// Paths to play: into a singular configuration, and along a family.

import { frameAt } from "./arm.mjs";
import { distance } from "./distance.mjs";
import { apart, generator, project } from "./families.mjs";
import { spanOf } from "./limits.mjs";
import { norm } from "./linear.mjs";
import { measure } from "./measures.mjs";
import { freeOf } from "./sums.mjs";

const SWING = 0.6, LONGEST_STEP = 0.35;

function ratioAt(data, q) {
  const { sigma } = measure(data, q);
  return sigma[data.task.rank - 1] / (sigma[0] || 1);
}

// Configurations from a regular one into the singular `goal`: of many ways tried, the one on which
// the arm starts most regular and sigma_r falls steadily.
export function into(data, moved, goal, frames = 30) {
  const random = generator(9), n = goal.length;
  let best = null, score = -Infinity;
  for (const joints of [moved, goal.map((_, j) => j)]) {
    for (let way = 0; way < 60; way++) {
      const d = new Array(n).fill(0);
      for (const j of joints) d[j] = 2 * random() - 1;
      const most = Math.max(...joints.map((j) => Math.abs(d[j]))) || 1;
      const begin = goal.map((g, j) => {
        const [low, high] = spanOf(data.joints[j], data.task.lengthScale);
        const reach = data.joints[j].prismatic ? 0.4 * (high - low) : 1.1;
        return Math.min(Math.max(g + (d[j] / most) * reach, Math.min(low, g)), Math.max(high, g));
      });
      const ratios = Array.from({ length: 9 }, (_, k) => ratioAt(data, mix(begin, goal, k / 8)));
      let rises = 0;
      for (let k = 1; k < 9; k++) rises += Math.max(0, ratios[k] - ratios[k - 1]);
      if (ratios[0] - 2 * rises > score) { score = ratios[0] - 2 * rises; best = begin; }
    }
    if (score > 0.02) break;
  }
  const ease = Array.from({ length: frames }, (_, k) => (1 - Math.cos((Math.PI * k) / (frames - 1))) / 2);
  return ease.map((t, k) => (k === frames - 1 ? goal.slice() : mix(best, goal, t)));
}

const mix = (a, b, t) => a.map((x, i) => x + t * (b[i] - x));

// A closed curve on a family through `start`, all joints swinging; [] where none was found.
export function along(data, family, start, frames = 54) {
  const n = start.length, L = data.task.lengthScale;
  const branch = family.branches.reduce((best, b) => (off(b, start, data) < off(best, start, data) ? b : best));
  const limits = data.joints.map((joint) => spanOf(joint, L));
  for (const size of [1, 0.6, 0.3, 0.12]) {
    const path = [];
    for (let k = 0; k < frames; k++) {
      const phase = (2 * Math.PI * k) / frames;
      const q = start.map((s, j) => {
        const [low, high] = limits[j], swing = data.joints[j].prismatic ? 0.3 * (high - low) : SWING;
        const up = Math.max(high - s, 0), down = Math.max(s - low, 0), rhythm = 1 + (j % 2);
        const both = Math.min(Math.min(up, down), size * swing);
        const one = Math.min(Math.max(up, down), size * swing) * (up > down ? 1 : -1);
        return s + (both >= 0.4 * Math.abs(one) ? both * Math.sin(rhythm * phase) : (one * (1 - Math.cos(rhythm * phase))) / 2);
      });
      for (const v of branch.values) q[v.joint] = start[v.joint];
      const found = branch.equations.length ? project(branch.equations, q, freeOf(branch, n)) : q;
      if (!found) break;
      path.push(found);
    }
    if (path.length === frames && smooth(path, limits)) return path;
  }
  return [];
}

function smooth(path, limits) {
  let moved = 0;
  for (let k = 0; k < path.length; k++) {
    const next = path[(k + 1) % path.length];
    for (let j = 0; j < next.length; j++) {
      if (path[k][j] < limits[j][0] - 1e-9 || path[k][j] > limits[j][1] + 1e-9) return false;
      const step = Math.abs(next[j] - path[k][j]);
      if (step > LONGEST_STEP) return false;
      moved = Math.max(moved, step);
    }
  }
  return moved > 1e-6;
}

// How far q is from fulfilling a branch.
const off = (branch, q, data) =>
  norm(branch.values.map((v) => apart(q[v.joint], v.value, data.joints[v.joint].prismatic))) +
  (branch.equations.length ? Math.min(10, distance(data, { branches: [branch] }, q).upper) : 0);

// Frames of a path; the verdict looks at one family only.
export function framesOf(data, path, family) {
  return path.map((q) => frameAt(data, q, family ? [family] : data.families));
}
