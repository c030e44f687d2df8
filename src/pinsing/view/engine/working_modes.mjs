// All ways to reach the present pose of the output, by its legs: with the pose given they do not know of
// each other, so that what is found of one leg counts for all.

import { generator } from "./families.mjs";
import { scaled, subtract } from "./linear.mjs";
import { CLOSED, closure, everyJoint, gaussNewton, worst, wrap } from "./loops.mjs";
import { heldPose, placeOf, poseGap, poseOf } from "./pose_drive.mjs";

const STARTS = 40, SAME = 1e-4, MOST = 256, LOOSE = 1e-6;

// Configurations within the limits that a number of starts led to; flipped passive joints are one. Where the
// coordinates led leave the pose open (a Delta's platform may be twisted), each pose has its own.
export function workingByLegs(data, q) {
  const random = generator(947), goal = poseOf(data, placeOf(data, q)), poses = [];
  const inside = (x, joints) => joints.every((j) => x[j] >= (data.joints[j].lower ?? -Infinity) - 1e-9 && x[j] <= (data.joints[j].upper ?? Infinity) + 1e-9);
  const take = (x) => {
    const { R, t } = placeOf(data, x), mark = [...R.flat(), ...scaled(t, 1 / data.task.lengthScale)];
    let pose = poses.find((one) => worst(subtract(one.mark, mark)) <= SAME);
    if (!pose) poses.push(pose = { mark, at: x, legs: data.legs.map((joints) => ({ joints, found: [] })) });
    for (const { joints, found } of pose.legs) {
      const driven = joints.filter((j) => data.actuated.includes(j));
      const gap = (other) => worst(wrap(data, subtract(x, other)).filter((_, j) => driven.includes(j)));
      if (inside(x, joints) && found.every((other) => gap(other) > SAME)) found.push(x);
    }
  };
  take(q);
  for (let k = 0; k < STARTS; k++) {
    const drawn = data.joints.map(({ prismatic, lower, upper }) => {
      const most = prismatic ? data.task.lengthScale : Math.PI, low = lower ?? -most, high = upper ?? most;
      return low + random() * (high - low);
    });
    const { q: x, error } = heldPose(data, goal, drawn);
    if (error <= CLOSED) take(wrap(data, x));
  }
  const together = poses.flatMap(({ at, legs }) => legs.reduce((all, { joints, found }) =>
    all.flatMap((x) => found.map((y) => x.map((v, j) => (joints.includes(j) ? y[j] : v)))).slice(0, MOST), [at]));
  return together.filter((x) => worst(closure(data, x).residual) <= LOOSE)
    .map((x) => wrap(data, gaussNewton(data, x, everyJoint(data)).q)).filter((x) => poseGap(data, x, q) <= LOOSE && sameOutput(data, x, q));
}

// Rows of the output that are not led, as they depend on others, agree as well.
function sameOutput(data, x, q) {
  const [a, b] = [x, q].map((one) => placeOf(data, one)), { rows, lengthScale } = data.task;
  return rows.every((r) => r > 2 || Math.abs(a.t[r] - b.t[r]) <= LOOSE * lengthScale) &&
    (![3, 4, 5].every((r) => rows.includes(r)) || worst(subtract(a.R.flat(), b.R.flat())) <= LOOSE);
}
