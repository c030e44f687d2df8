// How far a configuration is from families, in radians (metres over the length scale): what is found is an
// upper bound, and what is certain a lower one.
//
// The nearest zero of the equations of a branch, with a proof that none is nearer: best-first branch and
// bound, as in the program. In a box around c each equation is |f(c) + g (x - c)| <= rest,
// a slab, with the rest from Taylor's theorem. The distance to box and slab is a bound, and the box shrinks to
// what the slabs, and the ball of the best point known, leave of it. The box of the least bound is looked at
// first, and halved.

import { apart, farFrom, jointsOf, lowerBound, project, slopesAt, sumAt, sumsOf, unitsOf } from "./families.mjs";
import { dot, generator, leastNorm, norm } from "./linear.mjs";
import { measure } from "./measures.mjs";

const GAP = 1e-6, FAR = 100, TINY = 1e-300; // GAP: of what is found and what is certain
const EACH = 32, LED = 20; // boxes from one from which a zero is sought to the next; looks that this counts as

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
    if (turn % EACH === EACH - 1) {
      work.left -= LED * made.terms;
      const found = improve(Array.from((turn + 1) % (4 * EACH) ? parent.near : parent.c));
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

const LONG = 200, MOST = 200; // terms of a branch from which on few starts are taken; the most of them
const CONFIRMED = 1e-6; // singular values: as in the program

const weightsOf = (data) => unitsOf(data).map((unit) => 1 / unit);

// No point of a branch is nearer to q than `under`, which is cheap to tell; `placed` is q with its joint
// values put in, and `fixed` how far that is.
function glance(branch, q, joints, weight) {
  const placed = q.slice();
  let square = 0;
  for (const v of branch.values) {
    const off = apart(q[v.joint], v.value, joints[v.joint].prismatic);
    placed[v.joint] = q[v.joint] - off;
    square += (off * weight[v.joint]) ** 2;
  }
  const fixed = Math.sqrt(square), bounds = branch.equations.map((e) => lowerBound(e, placed));
  return { placed, fixed, under: bounds.length ? Math.sqrt(square + Math.max(...bounds) ** 2) : fixed };
}

const CELLS = 240; // of a slider

// Pieces [a, b] of the slider of joint j, the others held at q, at which it is not proven that the arm is outside of
// zones { middle, half, far, meeting }: joint ranges, distances by name of family, and by how much more than that the
// nearest family has to be away unless the second is by `near` more.
export function zonesAlong(data, { middle, half, far, meeting }, q, j, low, high) {
  const { joints } = data, weight = weightsOf(data), x = q.slice(), step = (high - low) / CELLS, out = [];
  let before = null;
  const away = (f) => Math.min(...f.branches.map((b) => glance(b, x, joints, weight).under)) - far[f.name];
  const clear = () => {
    if (!x.every((v, i) => Math.abs(apart(v, middle[i], joints[i].prismatic)) <= half[i] + 1e-9)) return false;
    const off = data.families.filter((f) => far[f.name] > 0).map(away).sort((a, b) => a - b);
    return !(off[0] <= 0 || (off[0] <= meeting?.more && off[1] <= meeting.near));
  };
  for (let k = 0; k < CELLS; k++) {
    x[j] = low + (k + 0.5) * step;
    if (clear()) before = null;
    else if (before) before[1] = low + (k + 1) * step;
    else out.push((before = [low + k * step, low + (k + 1) * step]));
  }
  return out;
}

// Distance { lower, upper, q, branch } from q to a family; q is null where no point was found, and upper
// infinite. Joint values: both bounds are equal.
export function distance(data, family, q, terms = 0) {
  const { lower, best } = nearestOf(data, [family], q, terms);
  return best ? { lower, upper: best.upper, q: best.q, branch: best.branch } : { lower, upper: Infinity, q: null, branch: -1 };
}

// Nearest point of several families that is found: { lower, best: { family, branch, upper, lower, q } or
// null }. No family is nearer than `lower`, and not that of the point than best.lower. Beyond a glance and a few
// starts up to `terms` terms of equations are looked at, to bring both bounds together.
export function nearestOf(data, families, q, terms = 0) {
  const { joints } = data, weight = weightsOf(data), lowers = families.map(() => Infinity), work = { left: terms };
  const places = families.flatMap((family, index) => family.branches.map((branch, k) =>
    ({ index, k, branch, ...glance(branch, q, joints, weight) })));
  places.sort((a, b) => a.under - b.under);
  let best = null;
  places.forEach((place, turn) => {
    const { index, k, branch, placed, fixed, under } = place, most = best?.upper ?? Infinity;
    let found = { lower: under, upper: fixed, x: placed };
    if (under > most) found.x = null;
    else if (branch.equations.length) {
      const share = { left: work.left / (places.length - turn) };
      work.left -= share.left;
      found = nearestOn(branch, place, joints, weight, most, share, families[index].confirm ? own(data, families[index], q) : null);
      work.left += Math.max(0, share.left);
    }
    lowers[index] = Math.min(lowers[index], found.lower);
    if (found.x && found.upper < most) best = { index, family: families[index], branch: k, upper: found.upper, q: found.x };
  });
  const lower = Math.min(...lowers, best?.upper ?? Infinity);
  return { lower, best: best && { ...best, lower: Math.min(lowers[best.index], best.upper) } };
}

// Where equations hold at regular configurations too, the rank tells which zeros are the family's own; with
// those that are known, nearest first.
function own(data, { points = [] }, q) {
  const near = points.map((x) => x.map((v, j) => q[j] + apart(v, q[j], data.joints[j].prismatic)));
  near.sort((a, b) => farFrom(a, q, data) - farFrom(b, q, data));
  return { near, has: (x) => measure({ ...data, chain: data.nominal ?? data.chain }, x).ratio <= CONFIRMED };
}

// { lower, upper, x } of a branch with equations; x is null where no point nearer than `most` was found.
// `own`, unless null, says which zeros of the equations count; the bound holds for all of them.
function nearestOn(branch, { placed, fixed, under }, joints, weight, most, work, own) {
  const { equations } = branch, free = jointsOf(branch);
  const away = (x) => norm(x.map((v, j) => (v - placed[j]) * weight[j])), given = work.left;
  const led = (start, iterations) => {
    const onto = project(equations, start, free, iterations);
    if (!onto) return null;
    const x = settle(equations, onto, placed, free, weight) ?? onto, found = { x, upper: away(x) };
    if (own && found.upper < mine.upper && own.has(x)) mine = found;
    else if (own && away(onto) < mine.upper && own.has(onto)) mine = { x: onto, upper: away(onto) };
    return found;
  };
  const whole = (part) => Math.hypot(fixed, part), close = Math.max(1e-9, under * (1 + 1e-6));
  const known = most < Infinity ? Math.sqrt(Math.max(0, most * most - fixed * fixed)) : Infinity;
  let best = { x: null, upper: known }, mine = best, lower = under, closed = false;
  const keep = (found) => { if (found && found.upper < best.upper) best = found; };
  keep(led(placed, 25));
  if (work.left > 0 && whole(best.upper) > close) {
    const made = sumsOf(branch, weight), q = made.joints.map((j) => placed[j] * weight[j]);
    const improve = (x) => {
      const there = placed.slice();
      made.joints.forEach((j, k) => { there[j] = x[k] / weight[j]; });
      return led(there, 20);
    };
    const found = nearestZero(made, q, made.joints.map((j) => !joints[j].prismatic), best, fixed, work, improve);
    best = found;
    lower = Math.max(lower, whole(found.lower) * (1 - 4e-15));
    ({ closed } = found);
  }
  // No other start can end nearer than `close`.
  const nearest = () => (own ? mine : best), terms = equations.reduce((sum, e) => sum + e.phase.length, 0);
  const few = terms > LONG ? 1 : 8, count = own ? Math.min(MOST, Math.max(few, Math.floor(given / (100 * terms)))) : closed ? 0 : few;
  for (const start of [...(own ? own.near.slice(0, count) : []), ...starts(placed, free, weight, Math.max(0, count - (own?.near.length ?? 0)))]) {
    if (whole(nearest().upper) <= close) break;
    keep(led(start, 25));
  }
  const upper = whole(nearest().upper);
  return { lower: Math.min(lower, upper), upper, x: nearest().x };
}

// From a zero x of the equations along them to one near q: steps of least norm onto their linear parts, and
// back to q by `relax`, less where that swings.
function settle(equations, x, q, joints, weight) {
  let relax = 1, before = null;
  for (let k = 0; k < 60; k++) {
    const { values, rows } = slopesAt(equations, x, joints), delta = joints.map((j) => (x[j] - q[j]) * weight[j]);
    const A = rows.map((row) => row.map((v, i) => v / weight[joints[i]]));
    const onto = leastNorm(A, A.map((row, i) => relax * dot(row, delta) - values[i]), 1e-9);
    const step = onto.map((v, i) => v - relax * delta[i]), size = norm(step), cut = Math.min(1, 0.5 / Math.max(size, 1e-300));
    if (before && dot(step, before) < 0) relax /= 2;
    before = step;
    x = x.slice();
    joints.forEach((j, i) => { x[j] += (cut * step[i]) / weight[j]; });
    if (size < 1e-12) break;
  }
  return project(equations, x, joints, 20);
}

// Places to begin from to all sides of q; the same at every call.
function* starts(q, joints, weight, count) {
  const random = generator(7);
  for (let k = 0; k < count; k++) {
    const x = q.slice(), size = 0.3 * (k + 1);
    for (const j of joints) x[j] += (size * (2 * random() - 1)) / weight[j];
    yield x;
  }
}
