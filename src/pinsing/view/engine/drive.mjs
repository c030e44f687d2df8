// Driving a mechanism by hand: inputs move, the passive joints follow, no mode is jumped.

import { subtract, svd, transpose } from "./linear.mjs";
import { CLOSED, closure, combined, everyJoint, gaussNewton, passiveOf, worst } from "./loops.mjs";
import { assemblySign, motions } from "./mechanism.mjs";
import { leastSquares } from "./orthogonal.mjs";

const STEP = 0.05, SMALLEST = 1e-5, LEAVE = 0.02;
export const AT_TYPE_2 = 1e-6;

// Follow the passive joints from a closed q (n) to new inputs (n_a): { q, reached }, reached from 0 to 1.
//
// A start at a type 2 singularity, where two assembly modes meet, is left into the one that leads further
// towards the inputs; where both do, into the one of home.
export function drive(data, inputs, q) {
  const ways = inputs.every((v, k) => v === q[data.actuated[k]]) ? [] : waysOut(data, q);
  if (!ways.length) return walk(data, inputs, q);
  const found = ways.map((way) => walk(data, inputs, way));
  const worth = ({ q: end, reached }) => Math.round(1000 * reached) + (assemblySign(data, end) === "+" ? 0.5 : 0);
  return worth(found[1]) > worth(found[0]) ? found[1] : found[0];
}

function waysOut(data, q) {
  const { basis, inputs, two } = motions(data, q);
  if (two > AT_TYPE_2) return [];
  const { left } = svd(transpose(inputs)), along = combined(basis, left[left.length - 1]);
  return [1, -1].map((side) => gaussNewton(data, q.map((v, j) => v + side * LEAVE * along[j] * data.metric[j]), everyJoint(data)).q);
}

// Newton with continuation on the straight path of the inputs, in steps that are halved where Newton
// would leave the assembly mode; it stops at the type 2 singularity where the mode ends.
function walk(data, target, start) {
  const { actuated, metric } = data, free = passiveOf(data);
  let { q, error } = gaussNewton(data, start, free);
  if (error > CLOSED) return { q: start.slice(), reached: 0 };
  const origin = actuated.map((j) => q[j]), units = actuated.map((j) => metric[j]);
  const distance = worst(subtract(target, origin).map((v, k) => v / units[k]));
  if (distance === 0) return { q, reached: 1 };
  const smallest = Math.min(1, SMALLEST / distance);
  let part = 0, step = Math.min(1, STEP / distance);
  while (part < 1) {
    const ahead = Math.min(1, part + step);
    const guess = predicted(data, q, target.map((v, k) => ((ahead - part) * (v - origin[k])) / units[k]), free);
    actuated.forEach((j, k) => { guess[j] = origin[k] + ahead * (target[k] - origin[k]); });
    // A corrector that runs off is about to jump to another assembly mode, or over a fold.
    const found = gaussNewton(data, guess, free, 12, STEP);
    if (found.error <= CLOSED) {
      q = found.q;
      part = ahead;
      step = Math.min(2 * step, STEP / distance);
      continue;
    }
    step /= 2;
    if (step < smallest) break;
  }
  return { q, reached: part };
}

function predicted(data, q, move, free) {
  const { G } = closure(data, q), used = free.flatMap((on, j) => (on ? [j] : []));
  const passive = leastSquares(G.map((row) => used.map((j) => row[j])),
    G.map((row) => -data.actuated.reduce((sum, j, k) => sum + row[j] * move[k], 0)), 1e-11);
  const longest = worst(passive), cut = longest > 2 * STEP ? (2 * STEP) / longest : 1, out = q.slice();
  used.forEach((j, i) => { out[j] += cut * passive[i] * data.metric[j]; });
  return out;
}
