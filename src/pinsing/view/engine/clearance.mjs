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

// Pose { q, lower } within the limits: the best of many, made better joint by joint.
export function clearestPose(data, tries = 1500) {
  const random = generator(11), L = data.task.lengthScale;
  const limits = data.joints.map((joint) => {
    const reach = joint.prismatic ? L : Math.PI, low = joint.lower ?? -reach, high = joint.upper ?? reach;
    // Beyond a turn nothing new is found.
    return joint.prismatic ? [low, high] : [Math.max(low, -Math.PI), Math.min(high, Math.PI)].map((v, i, all) => (all[0] < all[1] ? v : [low, high][i]));
  });
  const draw = () => limits.map(([low, high]) => low + random() * (high - low));
  const best = Array.from({ length: tries }, draw).map((q) => ({ q, lower: clearanceOf(data, q) }))
    .sort((a, b) => b.lower - a.lower).slice(0, 4);
  for (const pose of best) {
    for (let step = 0.4; step > 1e-3; step *= 0.7) for (let j = 0; j < pose.q.length; j++) for (const way of [-1, 1]) {
      const q = pose.q.slice(), [low, high] = limits[j];
      q[j] = Math.min(high, Math.max(low, q[j] + way * step * (data.joints[j].prismatic ? L : 1)));
      const lower = clearanceOf(data, q);
      if (lower > pose.lower) { pose.q = q; pose.lower = lower; }
    }
  }
  return best.reduce((a, b) => (b.lower > a.lower ? b : a));
}
