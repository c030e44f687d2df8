// Balls that a file writes as three hinges: where these lie in a plane, a gimbal lock, the ball itself
// still turns in every direction. Beside a lock the columns of its hinges are replaced by those of turns
// about the axes of the base through its centre, which span the same turns wherever the hinges are
// independent. As in `whole_balls.py`.

import { frameOf, jacobianOf } from "./chain.mjs";
import { cross, dot, identity, leastNorm, norm, subtract, times, transpose } from "./linear.mjs";

const BESIDE = 0.1; // volume of the three axes up to which a lock is near
const FLAT = 1e-6;

const axesOf = (data, places, ball) => ball.joints.map((j) => times(places[j].R, data.chain.joints[j].axis));

// Whether a ball is locked, or nearly.
export const locked = (data, places) => (data.balls ?? []).some((ball) => {
  const [a, b, c] = axesOf(data, places, ball);
  return Math.abs(dot(cross(a, b), c)) <= BESIDE;
});

// `jacobianOf` with whole balls: (chain, places, frame) to 6 x n.
export const ballColumns = (data) => (chain, places, frame) => {
  const J = jacobianOf(chain, places, frame), at = frameOf(frame, places).t;
  for (const { joints, centre } of data.balls) {
    if (norm(J.slice(3).map((row) => row[joints[2]])) === 0) continue; // the frame is not beyond it
    const arm = subtract(at, frameOf({ parent: joints[0], R: identity(3), t: centre }, places).t);
    identity(3).forEach((e, k) => [...cross(e, arm), ...e].forEach((v, i) => { J[i][joints[k]] = v; }));
  }
  return J;
};

// Joint velocities of motions (d vectors) in which balls are whole: three hinges in a plane show of a
// turn what they can, its part in that plane.
export const hingeRates = (data, places, basis) => basis.map((motion) => {
  const out = motion.slice();
  for (const ball of data.balls) {
    const turn = ball.joints.map((j) => motion[j]), axes = transpose(axesOf(data, places, ball));
    leastNorm(axes, turn, FLAT).forEach((v, k) => { out[ball.joints[k]] = v; });
  }
  return out;
});
