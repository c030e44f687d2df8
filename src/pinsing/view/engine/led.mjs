// The arm led by its tip, by damped least squares within the joint limits (C. W. Wampler, "Manipulator
// inverse kinematic solutions based on vector formulations and damped least-squares methods", 1986).

import { frameOf, jacobian, placements } from "./chain.mjs";
import { endsOf } from "./limits.mjs";
import { dot, product, rotationVector, scaled, subtract, svd, transpose } from "./linear.mjs";
import { taskRows } from "./measures.mjs";

const DAMPING = 0.03; // share of the largest singular value: below it a direction lags
const ROUNDS = 12, STEP = 0.1; // of one move of the pointer; radians, and shares of the arm's length, in a round

// Rotation of the tip, which `ledTip` holds.
export const tipRotation = (data, q) => frameOf(data.chain.tip, placements(data.chain, q)).R;

// From q (n) towards the tip at `goal` (3), with the rotations of the task held at R: { q, left, stuck }, the
// metres that are left, and the joints that would have to pass their limits.
export function ledTip(data, q, goal, R) {
  const turns = data.task.rows.flatMap((r, i) => (r > 2 ? [i] : [])), length = data.judge.length;
  const task = { lengthScale: length, rows: [0, 1, 2, ...turns.map((i) => data.task.rows[i])],
                 atTip: [false, false, false, ...turns.map((i) => Boolean(data.task.atTip?.[i]))] };
  let here = q.slice(), stuck = [];
  for (let round = 0; round < ROUNDS; round++) {
    const places = placements(data.chain, here), tip = frameOf(data.chain.tip, places);
    const off = taskRows([...subtract(goal, tip.t), ...rotationVector(product(R, transpose(tip.R)))].map((v) => [v]), task, tip.R).map(([v]) => v);
    const size = Math.sqrt(dot(off, off));
    if (size < 1e-9) break;
    const A = taskRows(jacobian(data.chain, places), task, tip.R), wanted = scaled(off, Math.min(1, STEP / size));
    const held = new Set();
    let move, stops;
    do {
      move = damped(A, wanted, held, data, length);
      stops = data.joints.flatMap((joint, j) => (!held.has(j) && stopped(joint, here[j], move[j]) ? [j] : []));
      stops.forEach((j) => held.add(j));
    } while (stops.length);
    stuck = [...held];
    here = here.map((v, j) => {
      const [low, high] = endsOf(data.joints[j]);
      return Math.max(Math.min(v + move[j], Math.max(v, high)), Math.min(v, low));
    });
  }
  const left = subtract(goal, frameOf(data.chain.tip, placements(data.chain, here)).t);
  return { q: here, left: Math.sqrt(dot(left, left)), stuck };
}

// Whether a joint is at its limit, and is to go on.
function stopped(joint, value, move) {
  const [low, high] = endsOf(joint);
  return move < 0 ? value <= low : move > 0 && value >= high;
}

function damped(A, wanted, held, { joints }, length) {
  const unit = joints.map((joint, j) => (held.has(j) ? 0 : joint.prismatic ? length : 1));
  const { sigma, left, right } = svd(A.map((row) => row.map((v, j) => v * unit[j]))), damping = (DAMPING * sigma[0]) ** 2;
  const out = unit.map(() => 0);
  sigma.forEach((s, k) => {
    const part = s > 0 ? (s / (s * s + damping)) * dot(left[k], wanted) : 0;
    right[k].forEach((v, j) => { out[j] += part * v * unit[j]; });
  });
  const most = Math.max(...out.map((v, j) => Math.abs(v) / (unit[j] || 1)));
  return scaled(out, Math.min(1, STEP / (most || 1)));
}
