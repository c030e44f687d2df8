// Orthogonal factors by Householder reflections with exchange of columns (P. Businger and G. H. Golub,
// 1965). Where the rank is clear they give what singular values give, many times sooner.

import { leastNorm, svd, transpose } from "./linear.mjs";

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
