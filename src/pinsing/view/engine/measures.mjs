// What is read off a Jacobian: singular values, verdict, velocity ellipsoids.

import { cross, dot, scaled, svd, transpose } from "./linear.mjs";

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

// Six-vector in base axes of one whose components are those of the task's rows.
export function inBase(u, task, R) {
  const out = new Array(6).fill(0);
  task.rows.forEach((r, i) => {
    const axis = r % 3, first = r - axis;
    if (!task.atTip?.[i]) out[r] += u[r];
    else for (let k = 0; k < 3; k++) out[first + k] += R[k][axis] * u[r];
  });
  return out;
}

// Singular, near-singular or regular: sigma_r / max(sigma_1, size), as Python's kinematics judges.
export function verdictOf(sigma, rank, judge) {
  const first = Math.max(sigma[0], judge.size);
  const ratio = first > 0 ? sigma[rank - 1] / first : 0;
  const status = ratio <= judge.rtol ? "singular" : ratio <= judge.nearRtol ? "near-singular" : "regular";
  return { ratio, status };
}

// Ellipsoid { axes: three directions, radii: largest first } of three rows under unit joint speed
// (Zhang, Fan, Wang, Cheng, Eqs. 15 and 16); axes form a right-handed frame.
export function ellipsoid(rows) {
  const { sigma, left } = svd(rows);
  const axes = left.map((a) => a.slice());
  if (dot(cross(axes[0], axes[1]), axes[2]) < 0) axes[2] = scaled(axes[2], -1);
  return { axes, radii: [0, 1, 2].map((k) => sigma[k] ?? 0) };
}

// Ellipsoids of the pure translations (omega = 0), and of the turns that leave the tip at rest:
// these go flat where a wrench (f, m) needs no joint torque, along f and along m.
export function pureEllipsoids(J, rtol) {
  const v = J.slice(0, 3), w = J.slice(3);
  return { translation: ellipsoid(atRest(v, w, rtol)), rotation: ellipsoid(atRest(w, v, rtol)) };
}

// What is left of `rows` under the joint speeds that leave `others` at rest.
function atRest(rows, others, rtol) {
  const { sigma, right } = svd(others);
  const kept = right.filter((_, k) => sigma[k] > rtol * Math.max(sigma[0], 1e-300));
  return rows.map((row) => {
    const out = row.slice();
    for (const r of kept) {
      const part = dot(row, r);
      for (let i = 0; i < out.length; i++) out[i] -= part * r[i];
    }
    return out;
  });
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
