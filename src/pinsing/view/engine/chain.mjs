// Forward kinematics and frame Jacobians of a tree of joints.
//
// A chain is { joints: [{ parent, R, t, axis, prismatic, weights, offset }], tip: { parent, R, t } }:
// joint i stands at (R, t) in the frame of joint `parent` (-1: the base) and turns about, or slides
// along, the unit `axis` by weights . q + offset (mimic joints have weights other than one).
// Metres and radians, in the base of the arm.

import { add, cross, product, rotation, scaled, subtract, times } from "./linear.mjs";

// Placement [{ R, t }] of each joint at q (n).
export function placements(chain, q) {
  const out = [];
  for (const joint of chain.joints) {
    let value = joint.offset;
    const { weights } = joint;
    for (let k = 0; k < q.length; k++) if (weights[k] !== 0) value += weights[k] * q[k];
    const own = joint.prismatic
      ? { R: joint.R, t: add(joint.t, scaled(times(joint.R, joint.axis), value)) }
      : { R: product(joint.R, rotation(joint.axis, value)), t: joint.t };
    out.push(joint.parent < 0 ? own : after(out[joint.parent], own));
  }
  return out;
}

// Placement of a frame { parent, R, t } among the placements of the joints.
export const frameOf = (frame, places) =>
  (frame.parent < 0 ? { R: frame.R, t: frame.t } : after(places[frame.parent], frame));

const after = (a, b) => ({ R: product(a.R, b.R), t: add(times(a.R, b.t), a.t) });

// Frame Jacobian (6 x n) of a frame { parent, R, t }, by default the tip: rows vx, vy, vz, wx, wy, wz in
// base axes, per unit joint speed (as pin.computeFrameJacobian, LOCAL_WORLD_ALIGNED).
export function jacobian(chain, places, frame = chain.tip) {
  const tip = frameOf(frame, places).t;
  const n = chain.joints.length ? chain.joints[0].weights.length : 0;
  const J = Array.from({ length: 6 }, () => new Array(n).fill(0));
  for (let j = frame.parent; j >= 0; j = chain.joints[j].parent) {
    const joint = chain.joints[j], axis = times(places[j].R, joint.axis);
    const twist = joint.prismatic ? [...axis, 0, 0, 0] : [...cross(axis, subtract(tip, places[j].t)), ...axis];
    const { weights } = joint;
    for (let k = 0; k < n; k++) {
      const w = weights[k];
      if (w !== 0) for (let i = 0; i < 6; i++) J[i][k] += w * twist[i];
    }
  }
  return J;
}
