// What is read off a configuration and its Jacobian: singular values, verdict, ellipsoids, tip speeds.

import { frameOf, jacobian, placements } from "./chain.mjs";
import { beside, combinations, cross, dot, norm, nullVector, product, scaled, svd, times, transpose } from "./linear.mjs";

// Rows of the task, translations over the length scale; R is the rotation of the tip, whose axes
// some of the rows may be along (`task.atTip`).
export const taskRows = (J, task, R) =>
  task.rows.map((r, i) => {
    const row = task.atTip?.[i] ? along(J, r, R) : J[r];
    return r < 3 ? scaled(row, 1 / task.lengthScale) : row.slice();
  });

// Row r of a frame Jacobian in the axes of the tip.
function along(J, r, R) {
  const axis = r % 3, first = r - axis;
  return J[r].map((_, j) => R[0][axis] * J[first][j] + R[1][axis] * J[first + 1][j] + R[2][axis] * J[first + 2][j]);
}

// Six-vector in base axes of one by the task's rows; R is the rotation of the tip.
export function inBase(u, task, R) {
  const out = new Array(6).fill(0);
  task.rows.forEach((r, i) => {
    const axis = r % 3, first = r - axis;
    if (!task.atTip?.[i]) out[r] += u[i];
    else for (let k = 0; k < 3; k++) out[first + k] += R[k][axis] * u[i];
  });
  return out;
}

// Singular, near-singular or regular: sigma_r / max(sigma_1, size), as Python's kinematics judges.
function verdictOf(sigma, rank, judge) {
  const first = Math.max(sigma[0], judge.size);
  const ratio = first > 0 ? sigma[rank - 1] / first : 0;
  const status = ratio <= judge.rtol ? "singular" : ratio <= judge.nearRtol ? "near-singular" : "regular";
  return { ratio, status };
}

// Ellipsoid { axes: three directions, radii: largest first } of three rows under unit joint speed
// (Zhang, Fan, Wang, Cheng, Eqs. 15 and 16); axes form a right-handed frame.
function ellipsoid(rows) {
  const { sigma, left } = svd(rows);
  const axes = left.map((a) => a.slice());
  if (dot(cross(axes[0], axes[1]), axes[2]) < 0) axes[2] = scaled(axes[2], -1);
  return { axes, radii: [0, 1, 2].map((k) => sigma[k] ?? 0) };
}

// { all, pure } ellipsoids, each { translation, rotation }, of a Jacobian, as `shown(ellipsoid, kind, pure)` has
// them: of the tip's velocity, whatever it turns by, and of pure translations (omega = 0) and of turns that
// leave the tip at rest. These go flat where a wrench (f, m) needs no joint torque, along f and along m.
export function ellipsoids(J, rtol, shown) {
  const v = J.slice(0, 3), w = J.slice(3);
  const pair = (a, b, pure) => ({ translation: shown(ellipsoid(a), "translation", pure), rotation: shown(ellipsoid(b), "rotation", pure) });
  return { all: pair(v, w, false), pure: pair(atRest(v, w, rtol), atRest(w, v, rtol), true) };
}

// What is left of `rows` under the joint speeds that leave `others` at rest.
function atRest(rows, others, rtol) {
  const { sigma, right } = svd(others);
  const kept = right.filter((_, k) => sigma[k] > rtol * Math.max(sigma[0], 1e-300));
  return rows.map((row) => beside(row, kept));
}

// Semi-axes as they are drawn, metres: what is flat is thickened to be seen, what is no motion is nothing.
export function drawnRadii(radii, scale, sizes) {
  if (radii[0] <= 1e-12) return [0, 0, 0];
  const largest = scale * radii[0], thinnest = Math.max(sizes.floor * largest, Math.min(sizes.least, sizes.slim * largest));
  return radii.map((r) => Math.max(scale * r, thinnest));
}

// Direction of the single semi-axis that is zero, if there is exactly one.
export function flatDirection({ axes, radii }, rtol) {
  if (radii[0] <= 0 || radii[2] > rtol * radii[0] || radii[1] <= rtol * radii[0]) return null;
  return pointUp(axes[2]);
}

// Of d and -d, the one whose largest component is positive.
export function pointUp(d) {
  let k = 0;
  for (let i = 1; i < d.length; i++) if (Math.abs(d[i]) > Math.abs(d[k]) + 1e-9) k = i;
  return d[k] < 0 ? scaled(d, -1) : d.slice();
}

// Rank of a set of columns of a matrix, singular values at or below `zero` left out.
export function rankOf(columns, zero) {
  if (!columns.length) return 0;
  const A = columns.length < columns[0].length ? columns : transpose(columns);
  return svd(A).sigma.filter((s) => s > zero).length;
}

// Kinematics and verdict at q (n): the part that is cheap.
export function measure(data, q) {
  const { task, judge } = data;
  const places = placements(data.chain, q), tip = frameOf(data.chain.tip, places);
  const J = jacobian(data.chain, places), Js = taskRows(J, task, tip.R);
  const at = svd(Js), own = ownScale(data) ? { Js, ...at } : ownTask(data, J, tip.R);
  return { places, tip, J, sigma: at.sigma, own, ...verdictOf(own.sigma, task.rank, judge) };
}

// Whether the scale of the task is the arm's own, which verdicts are taken at.
const ownScale = ({ judge, task }) => judge.length === task.lengthScale && judge.columns.every((c) => c === 1);

// The task Jacobian at the arm's own scale, without units, and its decomposition.
function ownTask({ judge, task }, J, R) {
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
  const found = [...combinations(transpose(product(inside, A)), rank - 1)].map((few) => times(transpose(inside), few.length ? nullVector(few) : [1]));
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
