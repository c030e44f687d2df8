// Small dense linear algebra: vectors and matrices are plain arrays (a matrix is its rows).

export const dot = (a, b) => { let s = 0; for (let i = 0; i < a.length; i++) s += a[i] * b[i]; return s; };
export const norm = (a) => Math.sqrt(dot(a, a));
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const add = (a, b) => a.map((x, i) => x + b[i]);
export const subtract = (a, b) => a.map((x, i) => x - b[i]);
export const scaled = (a, s) => a.map((x) => x * s);
export const transpose = (A) => (A.length ? A[0].map((_, j) => A.map((row) => row[j])) : []);
export function times(A, v) {
  const out = new Array(A.length);
  for (let i = 0; i < A.length; i++) out[i] = dot(A[i], v);
  return out;
}
export function product(A, B) {
  const out = new Array(A.length), n = B.length ? B[0].length : 0;
  for (let i = 0; i < A.length; i++) {
    const row = A[i], made = (out[i] = new Array(n));
    for (let j = 0; j < n; j++) {
      let s = 0;
      for (let k = 0; k < row.length; k++) s += row[k] * B[k][j];
      made[j] = s;
    }
  }
  return out;
}
export const identity = (n) => Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => (i === j ? 1 : 0)));

// Rotation about a unit axis (Rodrigues).
export function rotation(axis, angle) {
  const [x, y, z] = axis, c = Math.cos(angle), s = Math.sin(angle), v = 1 - c;
  return [[c + x * x * v, x * y * v - z * s, x * z * v + y * s],
          [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
          [z * x * v - y * s, z * y * v + x * s, c + z * z * v]];
}

// Quaternion (x, y, z, w) of a rotation matrix.
export function quaternion(R) {
  const trace = R[0][0] + R[1][1] + R[2][2];
  if (trace > 0) {
    const s = 2 * Math.sqrt(trace + 1);
    return [(R[2][1] - R[1][2]) / s, (R[0][2] - R[2][0]) / s, (R[1][0] - R[0][1]) / s, s / 4];
  }
  const i = R[0][0] > R[1][1] && R[0][0] > R[2][2] ? 0 : R[1][1] > R[2][2] ? 1 : 2;
  const j = (i + 1) % 3, k = (i + 2) % 3, s = 2 * Math.sqrt(1 + R[i][i] - R[j][j] - R[k][k]);
  const q = [0, 0, 0, (R[k][j] - R[j][k]) / s];
  q[i] = s / 4;
  q[j] = (R[j][i] + R[i][j]) / s;
  q[k] = (R[k][i] + R[i][k]) / s;
  return q;
}

// Rotation vector of a rotation matrix.
export function rotationVector(R) {
  const [x, y, z, w] = quaternion(R), size = norm([x, y, z]), angle = 2 * Math.atan2(size, Math.abs(w)) * (w < 0 ? -1 : 1);
  return size > 0 ? scaled([x, y, z], angle / size) : [0, 0, 0];
}

// Quaternion of the shortest turn from z to a unit vector.
export function turnZTo(d) {
  if (d[2] < -1 + 1e-12) return [1, 0, 0, 0];
  const w = Math.sqrt((1 + d[2]) / 2);
  return [-d[1] / (2 * w), d[0] / (2 * w), 0, w];
}

// Singular values of A (m x n), all m left vectors and the right ones, largest first.
//
// One-sided Jacobi on the rows (M. R. Hestenes, "Inversion of matrices by biorthogonalization",
// 1958): rotations from the left make the rows orthogonal; their lengths are the singular values.
// Small ones come out with high relative accuracy (J. Demmel and K. Veselic, 1992). Where m > n
// the last m - n values are rounding, and set to zero.
export function svd(A) {
  const m = A.length, n = m ? A[0].length : 0;
  const rows = A.map((row) => row.slice()), left = identity(m);
  // Where the rank is less than the number of rows, some shrink without end, and turn nothing else any more.
  const nothing = (m > n ? 1e-40 : 1e-60) * rows.reduce((sum, row) => sum + dot(row, row), 0);
  for (let sweep = 0; sweep < 40; sweep++) {
    let turned = false;
    for (let i = 0; i < m - 1; i++) for (let j = i + 1; j < m; j++) {
      const a = dot(rows[i], rows[i]), b = dot(rows[j], rows[j]), c = dot(rows[i], rows[j]);
      if (Math.abs(c) <= 1e-15 * Math.sqrt(a * b) || Math.abs(c) < 1e-290 || a < nothing || b < nothing) continue;
      turned = true;
      const zeta = (b - a) / (2 * c);
      const t = (zeta >= 0 ? 1 : -1) / (Math.abs(zeta) + Math.sqrt(1 + zeta * zeta));
      const cs = 1 / Math.sqrt(1 + t * t), sn = cs * t;
      turn(rows[i], rows[j], cs, sn);
      turn(left[i], left[j], cs, sn);
    }
    if (!turned) break;
  }
  const sizes = rows.map(norm), order = sizes.map((_, i) => i).sort((i, j) => sizes[j] - sizes[i]);
  const sigma = order.map((i, place) => (place < n ? sizes[i] : 0));
  return {
    sigma: sigma.slice(0, Math.min(m, n)),
    left: order.map((i) => left[i]),
    right: order.slice(0, Math.min(m, n)).map((i, k) => (sigma[k] > 0 ? scaled(rows[i], 1 / sigma[k]) : rows[i])),
  };
}

function turn(a, b, c, s) {
  for (let k = 0; k < a.length; k++) {
    const x = a[k], y = b[k];
    a[k] = c * x - s * y;
    b[k] = s * x + c * y;
  }
}

// x of least norm with A x = b in the least squares sense, singular values below rcond left out.
export function leastNorm(A, b, rcond = 1e-10) {
  const { sigma, left, right } = svd(A);
  const x = new Array(A[0].length).fill(0);
  sigma.forEach((s, k) => {
    if (s <= rcond * sigma[0] || s === 0) return;
    const part = dot(left[k], b) / s;
    for (let i = 0; i < x.length; i++) x[i] += part * right[k][i];
  });
  return x;
}
