// Kinematics and verdict at one configuration.

import { jacobian, placements, tipOf } from "./chain.mjs";
import { svd } from "./linear.mjs";
import { taskRows, verdictOf } from "./measures.mjs";

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
