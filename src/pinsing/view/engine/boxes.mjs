// The nearest zero of the equations of a branch, with a proof that none is nearer: best-first branch and
// bound, as in the program (bounds/nearest.py).
//
// In a box around c each equation is |f(c) + g (x - c)| <= rest, a slab, with the rest from Taylor's
// theorem. The distance to box and slab is a bound, and the box shrinks to what the slabs, and the ball
// of the best point known, leave of it. The box of the least bound is looked at first, and halved.

import { dot, leastNorm } from "./linear.mjs";
import { sumAt } from "./sums.mjs";

const GAP = 1e-6, FAR = 100, ON = 1e-12, TINY = 1e-300; // GAP: of what is found and what is certain

// Bounds { lower, upper, x } of the distance from q (d) to the zeros of `made` (see sumsOf), d its joints, all
// weighted; `turns` says which joints do. `best` { x, upper } is what is known, `fixed` the distance that
// other joints add; `improve(x)` leads a zero to one near q, { x, upper }, or gives null. It ends where
// work.left, terms of equations, is used up: `closed` says whether it came to its end.
export function nearestZero(made, q, turns, best, fixed, work, improve) {
  const d = q.length, part = { upper: best.upper, x: best.x };
  const row = () => new Float64Array(d);
  const s = { made, d, q, lo: row(), hi: row(), near: row(), point: row(), sum: row(), bend: row(), most: part.upper };
  const far = FAR + Math.max(...q.map(Math.abs));
  const goal = () => part.upper - 0.5 * GAP * Math.min(1, 100 * Math.hypot(part.upper, fixed));
  const boxes = []; // the least bound last
  let proven = Infinity, beyond = Infinity;
  const add = (box) => {
    let low = 0, high = boxes.length;
    while (low < high) { const middle = (low + high) >> 1; if (boxes[middle].low > box.low) low = middle + 1; else high = middle; }
    if (box.low >= goal()) proven = Math.min(proven, box.low);
    else boxes.splice(low, 0, box);
  };
  const least = () => (boxes.length ? boxes[boxes.length - 1].low : Infinity);
  const first = { c: row(), h: row(), near: row(), low: 0, widest: 0 };
  for (let j = 0; j < d; j++) {
    let reach = turns[j] ? Math.PI : far;
    if (part.upper < reach) reach = part.upper; // what lies farther away is of no use
    else if (!turns[j]) beyond = far;
    first.c[j] = q[j];
    first.h[j] = reach * (1 + 1e-15) + 4.6e-16 * (Math.abs(q[j]) + reach);
  }
  if (looked(s, first, 0, work)) add(first);
  for (let turn = 0; boxes.length && least() < goal() && work.left > 0; turn++) {
    const parent = boxes.pop();
    let zero = landed(s, parent.near, work);
    if (!zero && turn % 64 === 63) zero = landed(s, parent.c, work);
    if (zero) {
      const found = improve(Array.from(zero));
      if (found && found.upper < part.upper) Object.assign(part, found);
      s.most = part.upper;
    }
    const w = parent.widest;
    if (parent.low >= goal() || parent.h[w] < 1e-13) { proven = Math.min(proven, parent.low); continue; }
    for (const side of [-1, 1]) {
      const box = { c: parent.c.slice(), h: parent.h.slice(), near: parent.near.slice(), low: 0, widest: 0 };
      box.h[w] *= 0.5;
      box.c[w] += side * box.h[w];
      box.h[w] *= 1 + 4e-16;
      if (looked(s, box, parent.low, work)) add(box);
    }
  }
  const closed = !boxes.length || least() >= goal();
  proven = Math.min(proven, least());
  return { ...part, lower: Math.min(proven, part.upper, beyond) * (1 - 4e-15), closed };
}

// Fills in what is known of a box, and shrinks it; false where it holds no zero nearer than the best.
function looked(s, box, known, work) {
  const { d, q, lo, hi, near, bend, made } = s, { sums, at } = made;
  work.left -= made.terms;
  let total = 0;
  for (let j = 0; j < d; j++) {
    lo[j] = box.c[j] - box.h[j];
    hi[j] = box.c[j] + box.h[j];
    near[j] = Math.min(Math.max(q[j], lo[j]), hi[j]);
    total += (near[j] - q[j]) ** 2;
  }
  box.low = Math.max(known, Math.sqrt(total) * (1 - 4e-15));
  box.near.set(near);
  bend.fill(0);
  for (let i = 0; i < sums.length; i++) {
    const one = at[i];
    sumAt(sums[i], box.c, box.h, one);
    if (!cutBySlab(s, box, one.value, one.g, one.rest)) return false;
    let steep = TINY;
    for (let j = 0; j < d; j++) steep += Math.abs(one.g[j]) * box.h[j] + one.bend[j];
    for (let j = 0; j < d; j++) bend[j] = Math.max(bend[j], one.bend[j] / steep);
  }
  if (sums.length > 1 && !cutByCombination(s, box)) return false;
  let top = -1;
  for (let j = 0; j < d; j++) {
    const score = box.h[j] * (bend[j] + 1e-3);
    if (score > top) { top = score; box.widest = j; }
  }
  return box.low < s.most && shrunk(s, box);
}

// Raises the bound of a box by the slab |value + g (x - c)| <= rest; false where they do not meet.
function cutBySlab(s, box, value, g, rest) {
  const { d, q, lo, hi, near, point } = s;
  let reach = rest, origin = value, here = value;
  for (let j = 0; j < d; j++) {
    reach += Math.abs(g[j]) * box.h[j];
    origin -= g[j] * box.c[j];
    here += g[j] * (near[j] - box.c[j]);
  }
  if (Math.abs(value) > reach * (1 + 1e-14)) return false;
  if (Math.abs(here) <= rest) return true;
  const bound = toPlane(q, lo, hi, g, origin, here > 0 ? rest : -rest, d, point);
  if (bound === Infinity) return false;
  if (bound > box.low) { box.low = bound; box.near.set(point); }
  return true;
}

// A bound of the distance from q to {x in the box: origin + g x = target}, infinite where that is empty;
// its minimiser goes to `point`.
//
// For any multiplier m weak duality gives distance^2 >= min over y in the box of |y - q|^2 +
// 2 m (origin + g y - target), whose minimiser is q - m g cut to the box. The best m is the root of a sum
// that falls with it; how exact it is does not matter to the truth.
function toPlane(q, lo, hi, g, origin, target, d, point) {
  let sum = origin, least = origin, most = origin, size = Math.abs(origin) + Math.abs(target), steep = 0, total = 0;
  for (let j = 0; j < d; j++) {
    const y = Math.min(Math.max(q[j], lo[j]), hi[j]), a = g[j] * lo[j], b = g[j] * hi[j];
    point[j] = y;
    total += (y - q[j]) ** 2;
    sum += g[j] * y;
    least += Math.min(a, b);
    most += Math.max(a, b);
    size += Math.max(Math.abs(a), Math.abs(b));
    steep = Math.max(steep, Math.abs(g[j]));
  }
  const slack = 4e-16 * (d + 2) * size;
  if (target < least - slack || target > most + slack) return Infinity;
  const side = sum > target ? 1 : -1;
  let best = Math.sqrt(total) * (1 - 1e-15), low = 0, high = Infinity, at = 0;
  for (let k = 0; k < 60; k++) {
    const excess = side * (sum - target);
    if (Math.abs(excess) <= slack) break;
    if (excess > 0) low = at; else high = at;
    let slope = 0;
    for (let j = 0; j < d; j++) {
      const z = q[j] - side * at * g[j];
      if (z > lo[j] && z < hi[j]) slope += g[j] * g[j];
    }
    let next = slope > 0 ? at + excess / slope : Infinity;
    if (!(next > low && next < high)) next = high < Infinity ? 0.5 * (low + high) : 2 * at + 0.5 / steep;
    if (next === at || !(next < 1e200)) break;
    at = next;
    sum = origin;
    total = 0;
    for (let j = 0; j < d; j++) {
      const y = Math.min(Math.max(q[j] - side * at * g[j], lo[j]), hi[j]);
      point[j] = y;
      sum += g[j] * y;
      total += (y - q[j]) ** 2;
    }
    const square = total * (1 - 1e-15) + 2 * at * (side * (sum - target) - slack);
    if (square > 0) best = Math.max(best, Math.sqrt(square) * (1 - 1e-15));
  }
  return best;
}

// The slab of a sum of multiples of the equations: those of the step of least norm from `near`.
function cutByCombination(s, box) {
  const { d, near, sum, made: { at } } = s, k = at.length;
  const rows = at.map(({ g }) => Array.from(g)), products = rows.map((a) => rows.map((b) => dot(a, b)));
  const values = at.map(({ value, g }) => { let v = value; for (let j = 0; j < d; j++) v += g[j] * (near[j] - box.c[j]); return v; });
  const multiples = leastNorm(products, values, 1e-13); // any will do for a bound
  let value = 0, rest = 0, size = 0;
  sum.fill(0);
  for (let i = 0; i < k; i++) {
    const m = multiples[i];
    value += m * at[i].value;
    rest += Math.abs(m) * (at[i].rest + 1e-15 * at[i].size);
    size += Math.abs(m) * at[i].size;
    for (let j = 0; j < d; j++) sum[j] += m * at[i].g[j];
  }
  return !(size < 1e300) || cutBySlab(s, box, value, sum, rest);
}

// Shrinks a box to what the slab of each equation and the ball of the best point leave; false: nothing.
function shrunk(s, box) {
  const { d, q, lo, hi, most, made: { at } } = s;
  for (const one of at) {
    let reach = 0;
    for (let j = 0; j < d; j++) reach += Math.abs(one.g[j]) * box.h[j];
    const slack = one.rest + 4e-16 * (d + 4) * (Math.abs(one.value) + reach);
    for (let j = 0; j < d; j++) {
      const g = Math.abs(one.g[j]), own = g * box.h[j];
      // g (x_j - c_j) lies within `others` of -value.
      const others = (reach - own) * (1 + 1e-14) + slack;
      if (!(others - Math.abs(one.value) < own * (1 - 1e-14))) continue;
      const middle = -one.value / one.g[j], half = others / g;
      if (!(Math.abs(middle) < 1e200) || !(half < 1e200)) continue;
      const edge = 1e-15 * (Math.abs(box.c[j]) + Math.abs(middle) + half);
      lo[j] = Math.max(lo[j], box.c[j] + middle - half - edge);
      hi[j] = Math.min(hi[j], box.c[j] + middle + half + edge);
      if (lo[j] > hi[j]) return false;
    }
  }
  if (most < Infinity) {
    let total = 0;
    const off = (j) => Math.min(Math.max(q[j], lo[j]), hi[j]) - q[j];
    for (let j = 0; j < d; j++) total += off(j) ** 2;
    for (let j = 0; j < d; j++) {
      const square = most * most - (total - off(j) ** 2);
      const room = Math.sqrt(Math.max(square + 4e-15 * most * most, 0)) * (1 + 4e-15) + 1e-15 * Math.abs(q[j]);
      total -= off(j) ** 2;
      lo[j] = Math.max(lo[j], q[j] - room);
      hi[j] = Math.min(hi[j], q[j] + room);
      total += off(j) ** 2;
      if (lo[j] > hi[j]) return false;
    }
  }
  for (let j = 0; j < d; j++) {
    box.c[j] = 0.5 * (lo[j] + hi[j]);
    box.h[j] = 0.5 * (hi[j] - lo[j]) * (1 + 1e-15) + 2.3e-16 * (Math.abs(lo[j]) + Math.abs(hi[j]));
  }
  return true;
}

// From x straight onto the zeros, by Newton's method; null as soon as it does not get there, nearer than
// the best.
function landed(s, start, work) {
  const { d, q, most, made: { sums, at, terms } } = s, x = Array.from(start);
  let before = Infinity;
  for (let k = 0; k < 40; k++) {
    let square = 0, residual = 0;
    for (let j = 0; j < d; j++) square += (x[j] - q[j]) ** 2;
    if (Math.sqrt(square) >= most) return null;
    work.left -= terms;
    for (let i = 0; i < sums.length; i++) {
      sumAt(sums[i], x, null, at[i]);
      residual = Math.max(residual, Math.abs(at[i].value) / (at[i].size * Math.max(1, sums[i].noise * 1e13)));
    }
    if (residual <= ON) return x;
    if (residual > 0.7 * before) return null;
    before = residual;
    const step = leastNorm(at.map(({ g, size }) => Array.from(g, (v) => v / size)), at.map(({ value, size }) => -value / size), 1e-7);
    for (let j = 0; j < d; j++) x[j] += step[j];
  }
  return null;
}
