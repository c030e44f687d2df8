// The arm led by its tip, by damped least squares within the joint limits (C. W. Wampler, "Manipulator
// inverse kinematic solutions based on vector formulations and damped least-squares methods", 1986).

import { jacobian, placements, tipOf } from "./chain.mjs";
import { dot, product, rotationVector, scaled, subtract, svd, transpose } from "./linear.mjs";
import { taskRows } from "./measures.mjs";

const DAMPING = 0.03; // share of the largest singular value: below it a direction lags
const ROUNDS = 12, STEP = 0.1; // of one move of the pointer; radians, and shares of the arm's length, in a round

// Rotation of the tip, which `ledTip` holds.
export const tipRotation = (data, q) => tipOf(data.chain, placements(data.chain, q)).R;

// From q (n) towards the tip at `goal` (3), with the rotations of the task held at R: { q, left, stuck }, the
// metres that are left, and the joints that would have to pass their limits.
export function ledTip(data, q, goal, R) {
  const turns = data.task.rows.flatMap((r, i) => (r > 2 ? [i] : [])), length = data.judge.length;
  const task = { lengthScale: length, rows: [0, 1, 2, ...turns.map((i) => data.task.rows[i])],
                 atTip: [false, false, false, ...turns.map((i) => Boolean(data.task.atTip?.[i]))] };
  let here = q.slice(), stuck = [];
  for (let round = 0; round < ROUNDS; round++) {
    const places = placements(data.chain, here), tip = tipOf(data.chain, places);
    const off = taskRows([...subtract(goal, tip.t), ...rotationVector(product(R, transpose(tip.R)))].map((v) => [v]), task, tip.R).map(([v]) => v);
    const size = Math.sqrt(dot(off, off));
    if (size < 1e-9) break;
    const A = taskRows(jacobian(data.chain, places), task, tip.R), wanted = scaled(off, Math.min(1, STEP / size));
    const held = new Set();
    let move = damped(A, wanted, held, data, length);
    for (let again = true; again;) {
      again = false;
      for (const [j, { lower, upper }] of data.joints.entries()) {
        if (held.has(j) || !(move[j] < 0 ? here[j] <= (lower ?? -Infinity) : move[j] > 0 && here[j] >= (upper ?? Infinity))) continue;
        held.add(j);
        again = true;
      }
      if (again) move = damped(A, wanted, held, data, length);
    }
    stuck = [...held];
    here = here.map((v, j) => Math.max(Math.min(v + move[j], Math.max(v, data.joints[j].upper ?? Infinity)), Math.min(v, data.joints[j].lower ?? -Infinity)));
  }
  const left = subtract(goal, tipOf(data.chain, placements(data.chain, here)).t);
  return { q: here, left: Math.sqrt(dot(left, left)), stuck };
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
