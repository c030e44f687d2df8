// Kinematics and verdict at one configuration.

import { jacobian, placements, tipOf } from "./chain.mjs";
import { norm, product, scaled, svd, times, transpose } from "./linear.mjs";
import { taskRows, verdictOf } from "./measures.mjs";
import { nullVector } from "./orthogonal.mjs";

// Kinematics and verdict at q (n): the part that is cheap.
export function measure(data, q) {
  const { task, judge } = data;
  const places = placements(data.chain, q), tip = tipOf(data.chain, places);
  const J = jacobian(data.chain, places), Js = taskRows(J, task, tip.R);
  const at = svd(Js), own = ownScale(data) ? { Js, ...at } : ownTask(data, J, tip.R);
  return { places, tip, J, sigma: at.sigma, own, ...verdictOf(own.sigma, task.rank, judge) };
}

// Whether the scale of the task is the arm's own, which verdicts are taken at.
const ownScale = ({ judge, task }) => judge.length === task.lengthScale && judge.columns.every((c) => c === 1);

// The task Jacobian at the arm's own scale, without units, and its decomposition.
export function ownTask({ judge, task }, J, R) {
  const Js = taskRows(J, { ...task, lengthScale: judge.length }, R).map((row) => row.map((x, i) => x * judge.columns[i]));
  return { Js, ...svd(Js) };
}

// Tip speeds that joint speed limits allow in every direction at a Jacobian, by the facets of the zonotope of
// twists as in `tip_speed.py`: { linear, angular } with speed (m/s, rad/s), joints at their limits, direction;
// and the share of the limits that `asked` takes. Null where nothing can be said.
export function tipSpeeds({ speeds, task, judge, joints }, J, R) {
  if (!speeds) return null;
  const { basis, limits, asked } = speeds, zero = judge.rtol;
  const A = product(basis, taskRows(J, { ...task, lengthScale: judge.length }, R)), { sigma, left } = svd(A);
  const rank = sigma.filter((s) => s > zero * sigma[0]).length, inside = left.slice(0, rank);
  const found = chosen(transpose(product(inside, A)), rank - 1).map((few) => times(transpose(inside), few.length ? nullVector(few) : [1]));
  const facets = [...found, ...left.slice(rank)].map((y) => {
    const through = times(transpose(A), y).map((x) => (Math.abs(x) > zero * sigma[0] ? Math.abs(x) : 0));
    const parts = [true, false].map((linear) => y.map((c, i) => (speeds.linear[i] === linear && Math.abs(c) > zero ? c : 0)));
    return { parts, through, h: through.reduce((sum, x, j) => sum + (x ? x * (limits[j] ?? Infinity) : 0), 0) };
  });
  const worst = (v, w) => facets.reduce((most, { parts, through, h }) => {
    const taken = (v / judge.length) * norm(parts[0]) + w * norm(parts[1]), share = taken ? taken / h : 0;
    return share > most.share ? { share, parts, through } : most;
  }, { share: 0, through: [] });
  const named = ({ share, through, parts }, kind) => {
    const direction = [0, 0, 0];
    if (share) times(transpose(basis), parts[kind]).forEach((x, i) => { direction[task.rows[i] % 3] += x; });
    const size = norm(direction) || 1;
    return { speed: 1 / share, joints: joints.filter((_, j) => through[j]).map((joint) => joint.name), direction: scaled(direction, 1 / size) };
  };
  return { linear: named(worst(1, 0), 0), angular: named(worst(0, 1), 1), share: worst(...asked).share };
}

// All choices of `count` of some things.
function chosen(things, count, from = 0) {
  if (!count) return [[]];
  return things.slice(from).flatMap((x, k) => chosen(things, count - 1, from + k + 1).map((rest) => [x, ...rest]));
}
