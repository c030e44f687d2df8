// Poses that a search finds: the clearest of all families, and the nearest singular one.

import { distance, nearestOf } from "./distance.mjs";
import { apart, farFrom, generator, project } from "./families.mjs";
import { outside, spanOf, turnedInto } from "./limits.mjs";
import { measure } from "./measures.mjs";
import { freeOf } from "./sums.mjs";

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
  const random = generator(11), sites = new Sites(data), families = within(data);
  const limits = data.joints.map((joint) => drawnFrom(joint, data.task.lengthScale));
  const looked = (q, terms) => {
    const { lower, best } = nearestOf(data, families, q, terms);
    if (best) sites.add(best.family.branches[best.branch], best.q);
    return { q, lower, upper: best ? best.upper : Infinity, near: best && { entry: best.family.entry, q: best.q } };
  };
  const score = ({ lower, upper }) => lower + Math.min(upper, 1e9), better = (a, b) => (a && score(a) >= score(b) ? a : b);
  const draw = () => limits.map(([low, high]) => low + random() * (high - low));
  let top = null;
  for (const q of given.filter((q) => !outside(data, q).length)) top = better(top, looked(q.slice(), LOOK));
  const terms = families.reduce((sum, f) => sum + f.branches.reduce((t, b) => t + b.equations.reduce((s, e) => s + e.phase.length, 0), 0), 0);
  const rounds = terms ? Math.min(ROUNDS, Math.max(10, Math.floor(WORK / terms))) : 3;
  for (let round = 0; round < rounds; round++) {
    const starts = Array.from({ length: tries }, () => { const q = draw(); return { q, promise: sites.promise(q) }; });
    starts.sort((a, b) => b.promise - a.promise);
    const climbed = starts.slice(0, 3).concat(top ? [{ q: top.q, promise: sites.promise(top.q) }] : []).map((s) => climb(s, sites, limits, random));
    const next = climbed.reduce((a, b) => (b.promise > a.promise ? b : a));
    if (top && next.promise <= top.lower + ENOUGH) break;
    top = better(top, looked(next.q, LOOK));
  }
  return terms ? looked(top.q, LAST) : top;
}

// A hill of the promise: joint by joint, then all joints at once, in smaller and smaller steps.
function climb({ q, promise }, sites, limits, random) {
  let here = { q, promise };
  const tried = (step) => {
    const x = here.q.map((v, j) => (step[j] ? Math.min(limits[j][1], Math.max(limits[j][0], v + step[j] * sites.unit[j])) : v));
    const found = sites.promise(x);
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

// Points of families, each with the joints that make it one: the others are free.
class Sites {
  constructor(data) {
    this.joints = data.joints;
    this.unit = data.joints.map((joint) => (joint.prismatic ? data.task.lengthScale : 1));
    this.points = [];
    for (const { branches } of within(data)) for (const branch of branches) if (!branch.equations.length) this.add(branch, []);
  }

  add({ values, equations }, q) {
    const free = equations.length ? freeOf({ equations }, this.joints.length) : [];
    this.points.push([...values.map((v) => [v.joint, v.value]), ...free.flatMap((on, j) => (on ? [[j, q[j]]] : []))]);
  }

  // No family is farther from q than this.
  promise(q) {
    let least = Infinity;
    for (const point of this.points) {
      let square = 0;
      for (const [j, value] of point) {
        square += (apart(q[j], value, this.joints[j].prismatic) / this.unit[j]) ** 2;
        if (square >= least) break;
      }
      if (square < least) least = square;
    }
    return Math.sqrt(least);
  }
}

// From where to where a joint is drawn: beyond a turn nothing new is found.
function drawnFrom(joint, lengthScale) {
  const [low, high] = spanOf(joint, lengthScale);
  if (joint.prismatic) return [low, high];
  const [from, to] = [Math.max(low, -Math.PI), Math.min(high, Math.PI)];
  return from < to ? [from, to] : [low, high];
}

const SLACK = 1e-9, TURNS = 4, LISTED = 12, LOOK_AT_EACH = 200000; // LOOK_AT_EACH: terms of each family

// { q, value, least } or null: `q` is singular and within the limits, at `value`; no family is nearer
// than `least`. Beside points of the families near q, poses that are known (`listed`) are tried.
export function nearestSingular(data, q, listed = []) {
  const { joints, task } = data, tried = [];
  let least = Infinity;
  for (const family of data.families) {
    if (family.reachable === false) continue;
    const found = distance(data, family, q, LOOK_AT_EACH);
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
  for (let round = 0; round < TURNS; round++) {
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
