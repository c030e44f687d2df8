// How far a configuration is from families, in radians (metres over the length scale): what is found is an
// upper bound, and what is certain a lower one.

import { nearestZero } from "./boxes.mjs";
import { apart, farFrom, generator, lowerBound, project } from "./families.mjs";
import { dot, leastNorm, norm } from "./linear.mjs";
import { measure } from "./measures.mjs";
import { evaluate, freeOf, sumsOf } from "./sums.mjs";

const LONG = 200, MOST = 200; // terms of a branch from which on few starts are taken; the most of them
const CONFIRMED = 1e-6; // singular values: as in the program

const weightsOf = (joints, lengthScale) => joints.map((j) => (j.prismatic ? 1 / lengthScale : 1));

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
  const { joints, task } = data, weight = weightsOf(joints, task.lengthScale), x = q.slice(), step = (high - low) / CELLS, out = [];
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
  const { joints, task } = data, weight = weightsOf(joints, task.lengthScale), lowers = families.map(() => Infinity), work = { left: terms };
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
    const first = (one) => one.index * 1e6 + one.k;
    if (!found.x || found.upper > most || (found.upper === most && best && first(place) > first(best))) return;
    best = { index, k, family: families[index], branch: k, upper: found.upper, q: found.x };
  });
  const lower = Math.min(...lowers, best?.upper ?? Infinity);
  return { lower, best: best && { ...best, lower: Math.min(lowers[best.index], best.upper) } };
}

// Where equations hold at regular configurations too, the rank tells which zeros are the family's own; with
// those that are known, nearest first.
function own(data, { points = [] }, q) {
  const { joints, task } = data, weight = weightsOf(joints, task.lengthScale), off = (x) => norm(x.map((v, j) => (v - q[j]) * weight[j]));
  const near = points.map((x) => x.map((v, j) => q[j] + apart(v, q[j], joints[j].prismatic))).sort((a, b) => off(a) - off(b));
  return { near, has: (x) => measure({ ...data, chain: data.nominal ?? data.chain }, x).ratio <= CONFIRMED };
}

// { lower, upper, x } of a branch with equations; x is null where no point nearer than `most` was found.
// `own`, unless null, says which zeros of the equations count; the bound holds for all of them.
function nearestOn(branch, { placed, fixed, under }, joints, weight, most, work, own) {
  const { equations } = branch, free = freeOf(branch, placed.length);
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

function settle(equations, x, q, free, weight) {
  let relax = 1, before = null;
  for (let k = 0; k < 60; k++) {
    const found = equations.map((e) => evaluate(e, x));
    const A = found.map((r, i) => free.map((on, j) => (on ? r.gradient[j] / equations[i].size / weight[j] : 0)));
    const f = found.map((r, i) => r.value / equations[i].size);
    const delta = x.map((v, j) => (free[j] ? (v - q[j]) * weight[j] : 0));
    const along = leastNorm(A, A.map((row) => dot(row, delta)), 1e-9);
    const pull = along.map((v, j) => v - delta[j]);
    if (before && dot(pull, before) < 0) relax /= 2;
    before = pull;
    const back = leastNorm(A, f, 1e-9);
    const step = pull.map((v, j) => (free[j] ? relax * v - back[j] : 0));
    const size = norm(step), cut = Math.min(1, 0.5 / Math.max(size, 1e-300));
    x = x.map((v, j) => v + (cut * step[j]) / weight[j]);
    if (size < 1e-12) break;
  }
  return project(equations, x, free, 20);
}

// Places to begin from to all sides of q; the same at every call.
function* starts(q, free, weight, count) {
  const joints = free.flatMap((on, j) => (on ? [j] : []));
  const random = generator(7);
  for (let k = 0; k < count; k++) {
    const x = q.slice(), size = 0.3 * (k + 1);
    for (const j of joints) x[j] += (size * (2 * random() - 1)) / weight[j];
    yield x;
  }
}

// Nearest to q of single poses, in the same measure: { index, upper, q }, or null where there is none.
export function nearestPose(poses, q, joints, lengthScale) {
  const all = poses.map((pose, index) => ({ index, upper: farFrom(pose, q, joints, lengthScale), q: pose }));
  return all.reduce((a, b) => (a && a.upper <= b.upper ? a : b), null);
}
