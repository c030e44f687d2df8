// How clear a pose is of all families, and the clearest one that a search finds.

import { distance, generator } from "./families.mjs";

// No family within reach is nearer to q than this, radians (metres over the length scale).
export function clearanceOf(data, q) {
  let least = Infinity;
  for (const family of data.families) {
    if (family.reachable === false) continue;
    const found = bound(family, q, data);
    if (found < least) least = found;
  }
  return least;
}

function bound(family, q, data) {
  // Only the bound: points of the families are not looked for.
  const bare = family.bare ?? (family.bare = family.branches.map((branch) => ({ branches: [branch] })));
  return Math.min(...bare.map((one) => distance(one, q, data.joints, data.task.lengthScale, true).lower));
}

// Distance that is found to the nearest family, which is an upper bound of it.
function foundAt(data, q) {
  const found = data.families.filter((f) => f.reachable !== false)
    .map((f) => distance(f, q, data.joints, data.task.lengthScale)?.upper ?? Infinity);
  return Math.min(Infinity, ...found);
}

const TERMS = 6000; // of equations, times poses looked at where the bound is not the distance

// Pose { q, lower, upper } within the limits: the best of many and of those `given`, made better
// joint by joint, and then all joints at once. Where the bound falls short of the distance, the
// middle of both is climbed.
export function clearestPose(data, given = [], tries = 1500) {
  const random = generator(11), L = data.task.lengthScale;
  const unit = data.joints.map((joint) => (joint.prismatic ? L : 1));
  const limits = data.joints.map((joint) => {
    const reach = joint.prismatic ? L : Math.PI, low = joint.lower ?? -reach, high = joint.upper ?? reach;
    // Beyond a turn nothing new is found.
    return joint.prismatic ? [low, high] : [Math.max(low, -Math.PI), Math.min(high, Math.PI)].map((v, i, all) => (all[0] < all[1] ? v : [low, high][i]));
  });
  const draw = () => limits.map(([low, high]) => low + random() * (high - low));
  const judged = (q) => ({ q, lower: clearanceOf(data, q) });
  const within = (q) => q.every((v, j) => v >= (data.joints[j].lower ?? -Infinity) - 1e-9 && v <= (data.joints[j].upper ?? Infinity) + 1e-9);
  const kept = given.filter(within).map((q) => judged(q.slice()));
  const start = Array.from({ length: tries }, () => judged(draw())).sort((a, b) => b.lower - a.lower).slice(0, 4);
  const best = [...start, ...kept];
  const moved = (q, step) => q.map((v, j) => {
    const [low, high] = limits[j], x = v + step[j] * unit[j];
    return step[j] ? Math.min(high, Math.max(low, x)) : v;
  });
  for (const pose of best) {
    const climb = (step) => {
      const next = judged(moved(pose.q, step));
      if (next.lower <= pose.lower) return false;
      Object.assign(pose, next);
      return true;
    };
    for (let size = 0.4; size > 1e-3; size *= 0.7) for (let j = 0; j < pose.q.length; j++) for (const way of [-1, 1]) {
      climb(pose.q.map((_, i) => (i === j ? way * size : 0)));
    }
    for (let k = 0, size = 0.2; k < 400 && size > 1e-5; k++) size *= climb(pose.q.map(() => size * (2 * random() - 1))) ? 1.6 : 0.93;
  }
  const terms = data.families.reduce((sum, f) => sum + f.branches.reduce((t, b) => t + b.equations.reduce((s, e) => s + e.cos.length, 0), 0), 0);
  const full = (pose) => ({ ...pose, upper: terms ? foundAt(data, pose.q) : pose.lower });
  const score = ({ lower, upper }) => lower + upper, better = (a, b) => (score(b) > score(a) ? b : a);
  let top = [...best, ...given.filter(within).map((q) => judged(q.slice()))].map(full).reduce(better);
  const looks = terms ? Math.min(300, Math.floor(TERMS / terms)) : 0;
  for (let k = 0; k < looks; k++) top = better(top, full(judged(draw())));
  for (let k = 0, size = 0.3; k < looks && size > 1e-3; k++) {
    const next = full(judged(moved(top.q, top.q.map(() => size * (2 * random() - 1)))));
    size *= score(next) > score(top) ? 1.5 : 0.95;
    top = better(top, next);
  }
  return top;
}
