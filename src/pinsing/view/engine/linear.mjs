// Small dense linear algebra: vectors and matrices are plain arrays (a matrix is its rows).

export const dot = (a, b) => { let s = 0; for (let i = 0; i < a.length; i++) s += a[i] * b[i]; return s; };
export const norm = (a) => Math.sqrt(dot(a, a));
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const add = (a, b) => a.map((x, i) => x + b[i]);
export const subtract = (a, b) => a.map((x, i) => x - b[i]);
export const scaled = (a, s) => a.map((x) => x * s);
export const combined = (vectors, c) => vectors.reduce((sum, v, i) => add(sum, scaled(v, c[i])), vectors[0].map(() => 0));
// What is left of a vector beside orthonormal others.
export const beside = (u, others) => others.reduce((rest, d) => subtract(rest, scaled(d, dot(d, rest))), u);
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
// Rows along which something moves: at a place counted from 0, with parts of one; and a number of places, slowly at both ends.
export function rowAt(rows, place) {
  const a = rows[Math.floor(place)], b = rows[Math.min(Math.floor(place) + 1, rows.length - 1)];
  return a.map((v, j) => v + (place % 1) * (b[j] - v));
}
export const eased = (rows, count) => Array.from({ length: count }, (_, k) =>
  rowAt(rows, ((1 - Math.cos((Math.PI * k) / (count - 1))) / 2) * (rows.length - 1)));
export const identity = (n) => Array.from({ length: n }, (_, i) => Array.from({ length: n }, (_, j) => (i === j ? 1 : 0)));

// All choices of so many of some items.
export function* combinations(items, size, from = 0) {
  if (size === 0) yield [];
  for (let i = from; size > 0 && i <= items.length - size; i++) {
    for (const rest of combinations(items, size - 1, i + 1)) yield [items[i], ...rest];
  }
}

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
// Small ones come out with high relative accuracy (J. Demmel and K. Veselic, 1992). Where m > n it
// is the small triangle of A = Q R P^T, whose vectors are turned back.
export function svd(A) {
  const m = A.length, n = m ? A[0].length : 0;
  if (m > n && n) {
    const f = factored(columnsOf(A), m), { sigma, left, right } = svd(A[0].map((_, i) => upper(f, i, n)));
    const back = (part, at) => { const x = new Float64Array(m); x.set(part, at); return Array.from(turnedOut(f, x)); };
    return { sigma, left: [...left.map((u) => back(u, 0)), ...identity(m - n).map((e) => back(e, n))], right: right.map((v) => placed(f, v)) };
  }
  const rows = A.map((row) => row.slice()), left = identity(m);
  // Where the rank is less than the number of rows, some shrink without end, and turn nothing else any more.
  const nothing = 1e-60 * rows.reduce((sum, row) => sum + dot(row, row), 0);
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
  return {
    sigma: order.slice(0, n).map((i) => sizes[i]),
    left: order.map((i) => left[i]),
    right: order.slice(0, n).map((i) => (sizes[i] > 0 ? scaled(rows[i], 1 / sizes[i]) : rows[i])),
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

// A P = Q R by Householder reflections with exchange of columns (P. Businger and G. H. Golub, 1965): columns
// with the reflections below, R above the diagonal, R's own diagonal, and the sign of det Q det P. Where a
// diagonal entry is nothing beside the first, so are those after it.
function factored(columns, length) {
  const n = columns.length, count = Math.min(length, n), order = columns.map((_, j) => j);
  const diagonal = new Float64Array(count), beta = new Float64Array(count);
  let sign = 1;
  for (let s = 0; s < count; s++) {
    let best = s, most = -1;
    for (let j = s; j < n; j++) {
      let size = 0;
      for (let i = s; i < length; i++) size += columns[j][i] * columns[j][i];
      if (size > most) { most = size; best = j; }
    }
    if (best !== s) sign = -sign;
    [columns[s], columns[best]] = [columns[best], columns[s]];
    [order[s], order[best]] = [order[best], order[s]];
    if (most <= 0) continue;
    const v = columns[s], size = Math.sqrt(most), alpha = v[s] > 0 ? -size : size;
    v[s] -= alpha;
    diagonal[s] = alpha;
    beta[s] = -1 / (alpha * v[s]);
    sign = -sign;
    for (let j = s + 1; j < n; j++) reflect(v, beta[s], s, columns[j]);
  }
  return { columns, order, diagonal, beta, sign };
}

function reflect(v, beta, from, x) {
  let along = 0;
  for (let i = from; i < x.length; i++) along += v[i] * x[i];
  along *= beta;
  if (along !== 0) for (let i = from; i < x.length; i++) x[i] -= along * v[i];
}

// Row i of R (n columns); x of P^T x; Q x, in place.
function upper({ columns, diagonal }, i, n) {
  const row = new Array(n).fill(0);
  row[i] = diagonal[i];
  for (let j = i + 1; j < n; j++) row[j] = columns[j][i];
  return row;
}
function placed({ order }, y) {
  const x = new Array(order.length);
  order.forEach((j, k) => { x[j] = y[k]; });
  return x;
}
const turnedOut = ({ columns, beta }, x) => { for (let s = beta.length - 1; s >= 0; s--) reflect(columns[s], beta[s], s, x); return x; };

const rowsOf = (A) => A.map((row) => Float64Array.from(row));
const columnsOf = (A) => A[0].map((_, j) => { const c = new Float64Array(A.length); for (let i = 0; i < A.length; i++) c[i] = A[i][j]; return c; });

// x of least norm with A x = b in the least squares sense, up to the rank of A at rcond.
export function leastNorm(A, b, rcond = 1e-10) {
  const n = A[0].length, f = factored(columnsOf(A), A.length), { columns, diagonal, beta } = f, c = Float64Array.from(b);
  for (let s = 0; s < beta.length; s++) reflect(columns[s], beta[s], s, c);
  let rank = 0;
  while (rank < diagonal.length && Math.abs(diagonal[rank]) > rcond * Math.abs(diagonal[0])) rank++;
  const y = new Float64Array(n);
  if (rank === n) for (let i = n - 1; i >= 0; i--) {
    let sum = c[i];
    for (let j = i + 1; j < n; j++) sum -= columns[j][i] * y[j];
    y[i] = sum / diagonal[i];
  } else {
    // Of all solutions the shortest: along the rows of R.
    const g = factored(Array.from({ length: rank }, (_, i) => Float64Array.from(upper(f, i, n))), n);
    for (let k = 0; k < rank; k++) {
      let sum = c[g.order[k]];
      for (let i = 0; i < k; i++) sum -= g.columns[k][i] * y[i];
      y[k] = sum / g.diagonal[k];
    }
    turnedOut(g, y);
  }
  return placed(f, y);
}

// Unit vector that the rows of A send to zero; the last of several.
export function nullVector(A) {
  const n = A[0].length, x = new Float64Array(n);
  x[n - 1] = 1;
  return Array.from(turnedOut(factored(rowsOf(A), n), x));
}

// Determinant of a square matrix.
export function determinant(A) {
  const { diagonal, sign } = factored(rowsOf(A), A.length);
  return diagonal.reduce((product, d) => product * d, sign);
}

export const CLOSED = 1e-11; // a residual up to this counts as closed
export const worst = (values) => values.reduce((most, v) => Math.max(most, Math.abs(v)), 0);

// Newton's method by the joints `used`, in units of `metric`, none further than `reach` from the start: the best { q,
// error } of what `system(q)` says is to vanish, { values, rows (slopes by these joints) }.
//
// Steps are cut at half a radian: far from closure Newton's own would jump between assembly modes.
export function newton(metric, start, used, system, steps, reach = Infinity, goal = 1e-15) {
  let q = start.slice(), kept = q, best = Infinity;
  for (let k = 0; k <= steps; k++) {
    const { values, rows } = system(q), size = worst(values);
    if (size >= best && best <= CLOSED) break;
    if (size < best) { best = size; kept = q; }
    if (size <= goal) break;
    const step = leastNorm(rows, values.map((v) => -v), 1e-11), longest = worst(step), cut = longest > 0.5 ? 0.5 / longest : 1;
    q = q.slice();
    used.forEach((j, i) => { q[j] += cut * step[i] * metric[j]; });
    if (!(used.reduce((most, j) => Math.max(most, Math.abs(q[j] - start[j]) / metric[j]), 0) <= reach)) break;
  }
  return { q: kept, error: best };
}

// Numbers in [0, 1) that are the same everywhere (mulberry32).
export function generator(seed) {
  let a = seed >>> 0;
  return () => {
    a = (a + 0x6d2b79f5) >>> 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}
