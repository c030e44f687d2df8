// What a search finds: the clearest pose, the nearest singular one, and paths to play, into a singular
// configuration and along a family.

import { frameAt } from "./arm.mjs";
import { distance, nearestOf } from "./distance.mjs";
import { apart, farFrom, jointsOf, project, unitsOf } from "./families.mjs";
import { endsOf, isOutside, outside, turnedInto } from "./limits.mjs";
import { eased, generator, norm, rowAt } from "./linear.mjs";
import { measure } from "./measures.mjs";

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
        const { span: [low, high], prismatic } = data.joints[j], reach = prismatic ? 0.4 * (high - low) : 1.1;
        return Math.min(Math.max(g + (d[j] / most) * reach, Math.min(low, g)), Math.max(high, g));
      });
      const ratios = Array.from({ length: 9 }, (_, k) => ratioAt(data, rowAt([begin, goal], k / 8)));
      let rises = 0;
      for (let k = 1; k < 9; k++) rises += Math.max(0, ratios[k] - ratios[k - 1]);
      if (ratios[0] - 2 * rises > score) { score = ratios[0] - 2 * rises; best = begin; }
    }
    if (score > 0.02) break;
  }
  return eased([best, goal], frames);
}

// A closed curve on a family through `start`, all joints swinging; [] where none was found.
export function along(data, family, start, frames = 54) {
  const branch = family.branches.reduce((best, b) => (off(b, start, data) < off(best, start, data) ? b : best));
  const limits = data.joints.map((joint) => joint.span);
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
      const found = branch.equations.length ? project(branch.equations, q, jointsOf(branch)) : q;
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

const within = (data) => data.families.filter((f) => f.reachable !== false);

const LOOK = 20000, LAST = 5e6; // terms of equations for a pose that is tried, and for the one that is taken
const ROUNDS = 90, WORK = 9000; // poses tried at most, and times the terms of all equations
const ENOUGH = 1e-3; // radians: what is promised beyond the best

// Pose { q, lower, upper, near } within the limits, no worse than those `given`; `near` is the nearest point
// that was found of a family, { entry, q }.
//
// Points of families that are known ("sites") promise a bound of the distance, which is cheap to tell:
// where it is largest the distance is looked for, which gives one more site, and the promise falls until
// it is that of the best pose.
export function clearestPose(data, given = [], tries = 400) {
  const random = generator(11), families = within(data), limits = data.joints.map(drawnFrom), unit = unitsOf(data);
  const sites = families.flatMap(({ branches }) => branches.filter((b) => !b.equations.length).map((b) => siteOf(b, [])));
  const promise = (q) => promised(sites, q, data.joints, unit), start = (q) => ({ q, promise: promise(q) });
  const looked = (q, terms) => {
    const { lower, best } = nearestOf(data, families, q, terms);
    if (best) sites.push(siteOf(best.family.branches[best.branch], best.q));
    return { q, lower, upper: best ? best.upper : Infinity, near: best && { entry: best.family.entry, q: best.q } };
  };
  const score = ({ lower, upper }) => lower + Math.min(upper, 1e9), better = (a, b) => (a && score(a) >= score(b) ? a : b);
  const draw = () => limits.map(([low, high]) => low + random() * (high - low));
  let top = null;
  for (const q of given.filter((q) => !outside(data, q).length)) top = better(top, looked(q.slice(), LOOK));
  const terms = families.reduce((sum, f) => sum + f.branches.reduce((t, b) => t + b.equations.reduce((s, e) => s + e.phase.length, 0), 0), 0);
  const rounds = terms ? Math.min(ROUNDS, Math.max(10, Math.floor(WORK / terms))) : 3;
  for (let round = 0; round < rounds; round++) {
    const starts = Array.from({ length: tries }, () => start(draw())).sort((a, b) => b.promise - a.promise);
    const climbed = starts.slice(0, 3).concat(top ? [start(top.q)] : []).map((s) => climb(s, promise, limits, unit, random));
    const next = climbed.reduce((a, b) => (b.promise > a.promise ? b : a));
    if (top && next.promise <= top.lower + ENOUGH) break;
    top = better(top, looked(next.q, LOOK));
  }
  return terms ? looked(top.q, LAST) : top;
}

// A hill of the promise: joint by joint, then all joints at once, in smaller and smaller steps.
function climb({ q, promise: first }, promise, limits, unit, random) {
  let here = { q, promise: first };
  const tried = (step) => {
    const x = here.q.map((v, j) => (step[j] ? Math.min(limits[j][1], Math.max(limits[j][0], v + step[j] * unit[j])) : v));
    const found = promise(x);
    if (found <= here.promise) return false;
    here = { q: x, promise: found };
    return true;
  };
  for (let size = 0.5; size > 2e-4; size *= 0.6) for (let j = 0; j < q.length; j++) for (const way of [-1, 1]) {
    tried(q.map((_, i) => (i === j ? way * size : 0)));
  }
  for (let k = 0, size = 0.2; k < 150 && size > 1e-5; k++) size *= tried(q.map(() => size * (2 * random() - 1))) ? 1.6 : 0.93;
  return here;
}

// A point of a branch, by the joints that make it one: [[joint, value], ...]; the others are free.
const siteOf = ({ values, equations }, q) => [...values.map((v) => [v.joint, v.value]), ...jointsOf({ equations }).map((j) => [j, q[j]])];

// No family is farther from q than this.
function promised(sites, q, joints, unit) {
  let least = Infinity;
  for (const site of sites) {
    let square = 0;
    for (const [j, value] of site) {
      square += (apart(q[j], value, joints[j].prismatic) / unit[j]) ** 2;
      if (square >= least) break;
    }
    least = Math.min(least, square);
  }
  return Math.sqrt(least);
}

// From where to where a joint is drawn: beyond a turn nothing new is found.
function drawnFrom({ span, prismatic }) {
  const [low, high] = span;
  if (prismatic) return span;
  const [from, to] = [Math.max(low, -Math.PI), Math.min(high, Math.PI)];
  return from < to ? [from, to] : span;
}

const TURNS = 4, LISTED = 12, LOOK_AT_EACH = 200000; // LOOK_AT_EACH: terms of each family

// { q, value, least } or null: `q` is singular and within the limits, at `value`; no family is nearer
// than `least`. Beside points of the families near q, poses that are known (`listed`) are tried.
export function nearestSingular(data, q, listed = []) {
  const tried = [];
  let least = Infinity;
  for (const family of data.families) {
    if (family.reachable === false) continue;
    const found = distance(data, family, q, LOOK_AT_EACH);
    least = Math.min(least, found.lower);
    if (found.q) tried.push(settled(data, family.branches[found.branch], found.q));
  }
  const far = (x) => farFrom(x, q, data);
  tried.push(...listed.slice().sort((a, b) => far(a) - far(b)).slice(0, LISTED));
  const good = tried.filter((x) => x && !outside(data, x).length && singularAt(data, x)).map((x) => ({ q: x, value: far(x), least }));
  return good.length ? good.reduce((a, b) => (b.value < a.value ? b : a)) : null;
}

// Also where only the rounding of the file keeps it from being singular.
const singularAt = (data, q) => measure(data, q).status === "singular" ||
  (data.nominal !== null && data.nominal !== undefined && measure({ ...data, chain: data.nominal }, q).status === "singular");

// A point of the branch within the limits: whole turns first, then joints at their limits are held.
function settled({ joints }, branch, start) {
  let q = start.map((v, j) => turnedInto(endsOf(joints[j]), v, joints[j].prismatic)), free = jointsOf(branch);
  for (let round = 0; round < TURNS; round++) {
    const beyond = joints.map((joint, j) => {
      const [low, high] = endsOf(joint);
      return isOutside(joint, q[j]) ? (q[j] < low ? low : high) : null;
    });
    if (beyond.every((end) => end === null)) return q;
    if (beyond.some((end, j) => end !== null && branch.values.some((v) => v.joint === j))) return null;
    q = q.map((v, j) => beyond[j] ?? v);
    free = free.filter((j) => beyond[j] === null);
    if (!branch.equations.length) continue;
    q = project(branch.equations, q, free);
    if (!q) return null;
  }
  return null;
}
