// Small dense linear algebra: vectors and matrices are plain arrays (a matrix is its rows).

export const dot = (a, b) => { let s = 0; for (let i = 0; i < a.length; i++) s += a[i] * b[i]; return s; };
export const norm = (a) => Math.sqrt(dot(a, a));
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const add = (a, b) => a.map((x, i) => x + b[i]);
export const subtract = (a, b) => a.map((x, i) => x - b[i]);
export const scaled = (a, s) => a.map((x) => x * s);
export const combined = (vectors, c) => vectors.reduce((sum, v, i) => add(sum, scaled(v, c[i])), vectors[0].map(() => 0));
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

// Those left vectors of A whose singular values, 0 where there is none, fulfil `which(value, largest)`.
export function leftWhere(A, which) {
  const { sigma, left } = svd(A);
  return left.filter((_, k) => which(sigma[k] ?? 0, sigma[0]));
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

// Orthogonal factors by Householder reflections with exchange of columns (P. Businger and G. H. Golub,
// 1965). Where the rank is clear they give what singular values give, many times sooner.

// A diagonal entry of R, over the largest, is kept above CLEAR and dropped below NOTHING; between them
// the singular values are asked.
const CLEAR = 1e-6, NOTHING = 1e-13;

// A P = Q R: columns with the reflections below, R above the diagonal, and R's own diagonal.
function factored(columns, length) {
  const n = columns.length, count = Math.min(length, n), order = columns.map((_, j) => j);
  const diagonal = new Float64Array(count), beta = new Float64Array(count);
  for (let s = 0; s < count; s++) {
    let best = s, most = -1;
    for (let j = s; j < n; j++) {
      let size = 0;
      for (let i = s; i < length; i++) size += columns[j][i] * columns[j][i];
      if (size > most) { most = size; best = j; }
    }
    [columns[s], columns[best]] = [columns[best], columns[s]];
    [order[s], order[best]] = [order[best], order[s]];
    if (most <= 0) continue;
    const v = columns[s], size = Math.sqrt(most), alpha = v[s] > 0 ? -size : size;
    v[s] -= alpha;
    diagonal[s] = alpha;
    beta[s] = -1 / (alpha * v[s]);
    for (let j = s + 1; j < n; j++) reflect(v, beta[s], s, columns[j]);
  }
  return { columns, length, order, diagonal, beta };
}

function reflect(v, beta, from, x) {
  let along = 0;
  for (let i = from; i < x.length; i++) along += v[i] * x[i];
  along *= beta;
  if (along !== 0) for (let i = from; i < x.length; i++) x[i] -= along * v[i];
}

// Q^T x and Q x, in place.
const turnedIn = ({ columns, beta }, x) => { for (let s = 0; s < beta.length; s++) reflect(columns[s], beta[s], s, x); return x; };
const turnedOut = ({ columns, beta }, x) => { for (let s = beta.length - 1; s >= 0; s--) reflect(columns[s], beta[s], s, x); return x; };

function columnsOf(A) {
  return A[0].map((_, j) => { const c = new Float64Array(A.length); for (let i = 0; i < A.length; i++) c[i] = A[i][j]; return c; });
}

const rowsOf = (A) => A.map((row) => Float64Array.from(row));

// x of least norm with A x = b in the least squares sense, as `leastNorm`.
export function leastSquares(A, b, rcond = 1e-10) {
  const n = A[0].length, f = factored(columnsOf(A), A.length), { diagonal, columns, order } = f;
  const most = Math.abs(diagonal[0]);
  let rank = 0;
  while (rank < diagonal.length && Math.abs(diagonal[rank]) > CLEAR * most) rank++;
  if (!(most > 0) || (rank < diagonal.length && Math.abs(diagonal[rank]) > NOTHING * most)) return leastNorm(A, b, rcond);
  const c = turnedIn(f, Float64Array.from(b)), y = new Float64Array(n);
  const R = (i, j) => (i === j ? diagonal[i] : columns[j][i]);
  if (rank === n) {
    for (let i = n - 1; i >= 0; i--) {
      let sum = c[i];
      for (let j = i + 1; j < n; j++) sum -= R(i, j) * y[j];
      y[i] = sum / diagonal[i];
    }
  } else {
    // Of all solutions the shortest: along the rows of R.
    const rows = Array.from({ length: rank }, (_, i) => { const row = new Float64Array(n); for (let j = i; j < n; j++) row[j] = R(i, j); return row; });
    const g = factored(rows, n);
    for (let k = 0; k < rank; k++) {
      let sum = c[g.order[k]];
      for (let i = 0; i < k; i++) sum -= g.columns[k][i] * y[i];
      y[k] = sum / g.diagonal[k];
    }
    turnedOut(g, y);
  }
  const x = new Array(n);
  order.forEach((j, k) => { x[j] = y[k]; });
  return x;
}

// Unit vector that the rows of A send to zero; the last of several.
export function nullVector(A) {
  const n = A[0].length, f = factored(rowsOf(A), n), x = new Float64Array(n);
  x[n - 1] = 1;
  return Array.from(turnedOut(f, x));
}

// Singular values and all left vectors of A^T, as of `svd`: those of the small triangle, turned back.
export function svdOfTransposed(A) {
  const m = A.length, n = m ? A[0].length : 0;
  if (!(n > m)) return svd(transpose(A));
  const f = factored(rowsOf(A), n);
  const triangle = Array.from({ length: m }, (_, i) => Array.from({ length: m }, (_, j) => (i === j ? f.diagonal[i] : i < j ? f.columns[j][i] : 0)));
  const { sigma, left } = svd(triangle);
  const back = (part, at) => { const x = new Float64Array(n); x.set(part, at); return Array.from(turnedOut(f, x)); };
  return { sigma, left: [...left.map((u) => back(u, 0)), ...Array.from({ length: n - m }, (_, k) => back([1], m + k))] };
}
