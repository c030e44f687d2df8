// Motions that the arm cannot produce at a configuration: those that it loses there, and those that are
// missing at every configuration, of an arm with fewer joints than the task has rows.

import { dot, scaled, subtract, svd, transpose } from "./linear.mjs";
import { combined, EXACT, lostMotions, meetingPoint } from "./lost.mjs";
import { measure } from "./measured.mjs";
import { inBase } from "./measures.mjs";

const STEP = 1e-5; // radians (metres over the length scale): of a difference quotient

// { lost, always, mixed } at q, each motion as from lostMotions: `own` is the decomposition at the arm's own
// scale, of this rank. Where those lost cannot be told from those missing everywhere, all are in `lost`, and
// `mixed` says how many of them are missing everywhere.
export function missingAt(data, q, { J, own, rank, tip, status, ratio }) {
  const { task } = data, hardly = status === "near-singular";
  const describe = (rows, nearly, tol) => lostMotions(rows.map((u) => inBase(inAllRows(u, task), task, tip.R)), J, data.judge.length,
    { position: tip.t, rotation: tip.R, size: sizeOf(J), landmarks: landmarks(data, J, tip.t) }, tol, nearly);
  const said = (lost, always, mixed = 0) => ({
    lost: describe(lost, hardly, hardly ? Math.max(EXACT, Math.min(3 * ratio, 0.05)) : EXACT),
    always: describe(always, false, EXACT), mixed,
  });
  // Directions that the arm can produce nowhere, in task rows.
  const never = task.never.map((u) => task.rows.map((r) => u[r]));
  if (status !== "singular") return said(own.left.slice(rank, task.rank), own.left.slice(task.rank));
  const missing = without(own.left.slice(rank), never), more = missing.length - (task.rank - rank);
  if (more <= 0) return said(missing, never);
  const fresh = regained(data, q, own, missing, rank);
  return fresh.length === task.rank - rank ? said(fresh, [...without(missing, fresh), ...never]) : said(missing, never, more);
}

// What of the missing directions comes back where q is left, whichever way: with w missing and z a motion of
// the joints that leaves the task at rest, w . dJ z is how fast. Those of other arms stay missing.
function regained(data, q, own, missing, rank) {
  const still = svd(transpose(own.Js)).left.slice(rank), columns = [];
  q.forEach((_, k) => {
    const step = STEP * (data.joints[k].prismatic ? data.task.lengthScale : 1);
    const [up, down] = [step, -step].map((h) => measure(data, q.map((v, j) => (j === k ? v + h : v))).own.Js);
    for (const z of still) columns.push(missing.map((w) => up.reduce((sum, row, i) => sum + (w[i] * (dot(row, z) - dot(down[i], z))) / (2 * step), 0)));
  });
  if (!columns.length) return [];
  const { sigma, left } = svd(transpose(columns));
  return left.filter((_, k) => sigma[k] > 1e-6 * Math.max(sigma[0], 1e-6)).map((c) => combined(missing, c));
}

// Orthonormal basis of what is left of some vectors beside orthonormal others.
function without(vectors, others) {
  const rest = vectors.map((u) => others.reduce((r, d) => subtract(r, scaled(d, dot(d, u))), u));
  if (!rest.length) return [];
  const { sigma, left } = svd(transpose(rest));
  return left.filter((_, k) => (sigma[k] ?? 0) > 0.5);
}

function inAllRows(u, task) {
  const out = new Array(6).fill(0);
  task.rows.forEach((r, i) => { out[r] = u[i]; });
  return out;
}

// Greatest speed of the tip at unit speed of one turning joint: how long the arm is, metres.
function sizeOf(J) {
  let most = 0;
  J[0].forEach((_, i) => {
    if (J[3][i] || J[4][i] || J[5][i]) most = Math.max(most, Math.hypot(J[0][i], J[1][i], J[2][i]));
  });
  return most || 1;
}

const landmarks = (data, J, tip) =>
  data.centres.map(({ name, joints }) => ({ name: `the ${name}`, at: meetingPoint(J, joints, tip) }));
