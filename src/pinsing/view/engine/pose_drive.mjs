// A mechanism is led by its output or its inputs, and all joints follow; no mode is jumped.
//
// `data.pose` is { rows, turn, coordinates }: the coordinates in which the output can be led (0 to 2: x, y, z; 3 to 5:
// roll, pitch, yaw), and what the turning ones are: { kind: "full" } a rotation, led as one; "angles"
// some of roll, pitch and yaw, whose others follow; "axis" an angle about base axis `row` counted on from
// `at`, its value at the rotation `zero`. R = Rz(yaw) Ry(pitch) Rx(roll).

import { frameOf, jacobian } from "./chain.mjs";
import { valueText } from "./limits.mjs";
import { CLOSED, combined, dot, newton, product, rotationVector, svd, transpose, worst } from "./linear.mjs";
import { assemblySign, assemblyValue, closure, elbowSines, everyJoint, gaussNewton, motions, unitRows } from "./mechanism.mjs";

const STEP = 0.05, SMALLEST = 1e-6, TURN = 2 * Math.PI, INSIDE = 1e-9, RUN = 12, FAR = 0.2;
const MOST_ANGLE = 1e6, MOST_WAY = 1000; // radians; radians or length scales
const IN_LINE = 0.02, WEAK = 0.02, LEAVE = 0.02;
export const AT_TYPE_2 = 1e-6;

const shortest = (angle) => angle - TURN * Math.round(angle / TURN);

// Roll, pitch, yaw of a rotation, and its inverse.
export function anglesOf(R) {
  const pitch = Math.atan2(-R[2][0], Math.hypot(R[2][1], R[2][2]));
  if (Math.hypot(R[2][1], R[2][2]) < 1e-12) return [0, pitch, Math.atan2(-R[0][1], R[1][1])];
  return [Math.atan2(R[2][1], R[2][2]), pitch, Math.atan2(R[1][0], R[0][0])];
}

export function rotationOf([r, p, y]) {
  const [a, b] = [Math.cos(r), Math.sin(r)], [c, d] = [Math.cos(p), Math.sin(p)], [e, f] = [Math.cos(y), Math.sin(y)];
  return [[e * c, e * d * b - f * a, e * d * a + f * b], [f * c, f * d * b + e * a, f * d * a - e * b], [-d, c * b, c * a]];
}

// The led coordinates, in their order, of a placement of the output.
export function poseOf({ pose }, { R, t }) {
  const { turn } = pose, angles = turn?.kind === "axis" ? null : anglesOf(R);
  return pose.rows.map((row) => {
    if (row < 3) return t[row];
    return angles ? angles[row - 3] : turn.at + aboutAxis(product(R, transpose(turn.zero)), row - 3);
  });
}

function aboutAxis(R, k) {
  const i = (k + 1) % 3, j = (k + 2) % 3;
  return Math.atan2(R[j][i], R[i][i]);
}

// What is to vanish, without units, and its slopes: loops closed, and the coordinates at `goal`.
function system(data, q, goal) {
  const { residual, G, places } = closure(data, q), { pose, chain, metric, task } = data;
  const full = jacobian(chain, places), place = frameOf(chain.tip, places), now = poseOf(data, place);
  const slopes = (row, unit) => row.map((v, j) => v * metric[j] * unit);
  const errors = [], rows = [], angles = pose.turn?.kind === "angles" ? rates(anglesOf(place.R)) : null;
  pose.rows.forEach((row, k) => {
    if (row < 3) {
      errors.push((now[k] - goal[k]) / task.lengthScale);
      rows.push(slopes(full[row], 1 / task.lengthScale));
    } else if (pose.turn.kind !== "full") {
      errors.push(shortest(now[k] - goal[k]));
      rows.push(slopes(angles ? full[0].map((_, j) => dot(angles[row - 3], [full[3][j], full[4][j], full[5][j]])) : full[row], 1));
    }
  });
  if (pose.turn?.kind === "full") {
    const left = rotationVector(product(place.R, transpose(rotationOf(goal.slice(-3)))));
    left.forEach((v, k) => { errors.push(v); rows.push(slopes(full[3 + k], 1)); });
  }
  return { values: [...residual, ...errors], rows: [...G, ...rows] };
}

// Rows that send an angular velocity to the rates of roll, pitch and yaw.
function rates([, p, y]) {
  const [c, s, e, f] = [Math.cos(p), Math.sin(p), Math.cos(y), Math.sin(y)];
  return [[e / c, f / c, 0], [-f, e, 0], [(e * s) / c, (f * s) / c, 1]];
}

// Lead the output from a closed q (n) to a pose, coordinate by coordinate as `poseOf`: { q, reached, stop },
// reached from 0 to 1; `stop` says why it ends before: { why, joint }.
export function posed(data, goal, q) {
  const { pose, task } = data, start = poseOf(data, placeOf(data, q));
  const way = goal.map((v, k) => (pose.rows[k] < 3 ? v - start[k] : shortest(v - start[k])));
  const units = pose.rows.map((row) => (row < 3 ? task.lengthScale : 1));
  return led(data, q, worst(way.map((v, k) => v / units[k])),
    (x, part) => system(data, x, start.map((v, k) => v + part * way[k])));
}

// Lead some joints to values, the others as they least must.
function ledTo(data, joints, values, q, limits = bounds(data, q)) {
  const begin = joints.map((j) => q[j]), gap = (value, k) => (value - begin[k]) / data.metric[joints[k]];
  return led(data, q, worst(values.map(gap)), (x, part) => {
    const { residual, G } = closure(data, x);
    return { values: [...residual, ...joints.map((j, k) => gap(x[j], k) - part * gap(values[k], k))],
             rows: [...G, ...unitRows(data, joints)] };
  }, limits);
}

// Inputs driven from a closed q (n) as far as it goes; limits only if given.
//
// A start at a type 2 singularity, where two assembly modes meet, is left into the one that leads further
// towards the inputs; where both do, into the one of home.
export function drive(data, inputs, q, limits = data.joints.map(() => [-Infinity, Infinity])) {
  const still = inputs.every((v, k) => v === q[data.actuated[k]]), ways = still ? [] : waysOut(data, q);
  const found = (ways.length ? ways : [q]).map((way) => ledTo(data, data.actuated, inputs, way, limits));
  const worth = ({ q: end, reached }) => Math.round(1000 * reached) + (assemblySign(data, end) === "+" ? 0.5 : 0);
  return found.reduce((a, b) => (worth(b) > worth(a) ? b : a));
}

function waysOut(data, q) {
  const { basis, inputs, two } = motions(data, q);
  if (two > AT_TYPE_2) return [];
  const { left } = svd(transpose(inputs)), along = combined(basis, left[left.length - 1]);
  return [1, -1].map((side) => gaussNewton(data, q.map((v, j) => v + side * LEAVE * along[j] * data.metric[j])).q);
}

// Steps on the straight way of what is led, cut where Newton would run off or a joint would pass its limit.
function led(data, q, distance, values, least = bounds(data, q)) {
  const solved = (from, part) => newton(data.metric, from, everyJoint(data), (x) => values(x, part), RUN, FAR), begin = solved(q, 0);
  if (begin.error > CLOSED) return { q: q.slice(), reached: 0, stop: reason(data, q, least) };
  if (distance === 0) return { q: begin.q, reached: 1, stop: null };
  const smallest = Math.min(1, SMALLEST / distance);
  let at = begin.q, part = 0, step = Math.min(1, STEP / distance);
  while (part < 1) {
    const ahead = Math.min(1, part + step), found = solved(at, ahead);
    const share = found.error <= CLOSED ? inside(least, at, found.q) : 0;
    if (share >= 1) {
      at = found.q;
      part = ahead;
      step = Math.min(2 * step, STEP / distance);
      continue;
    }
    step = (ahead - part) * (found.error <= CLOSED ? Math.min(0.9, Math.max(0.02, share)) : 0.5);
    if (step < smallest) break;
  }
  return { q: at, reached: part, stop: part < 1 ? reason(data, at, least) : null };
}

// Limits; where a joint is beyond one already, it is not to go further.
const bounds = (data, q) => data.joints.map(({ lower, upper }, j) => [Math.min(lower ?? -Infinity, q[j]), Math.max(upper ?? Infinity, q[j])]);

// How much of the way from a to b all limits allow, 1 or more: all.
function inside(limits, a, b) {
  let share = 1;
  limits.forEach(([low, high], j) => {
    const over = b[j] > high + INSIDE ? high : b[j] < low - INSIDE ? low : null;
    if (over !== null) share = Math.min(share, (over - a[j]) / (b[j] - a[j]));
  });
  return share;
}

// Why it ends at q: a limit, a leg in line, loops that hold less, or loops that do not close.
function reason(data, q, limits) {
  const limit = q.findIndex((v, j) => Math.min(v - limits[j][0], limits[j][1] - v) <= 1e-5 * data.metric[j]);
  if (limit >= 0) return { why: "limit", joint: limit, q };
  const { one, two, constraint } = motions(data, q), straight = elbowSines(data, q).map(Math.abs);
  const least = straight.indexOf(Math.min(...straight)), inLine = least >= 0 && straight[least] <= IN_LINE;
  if (constraint <= WEAK) return { why: "constraint", q };
  if (two <= Math.min(WEAK, one)) return { why: "type 2", q };
  if (one <= WEAK || inLine) return { why: "type 1", joint: inLine ? data.elbows[least].crank : undefined, q };
  return { why: "open", q };
}

// The same in words.
export function stopWords(data, { why, joint, q }) {
  const name = joint === undefined ? "" : data.joints[joint].name;
  if (why === "limit") return `${name} is at its limit, ${valueText(data.joints[joint].prismatic, q[joint])}`;
  if (why === "open") return "the loops do not close beyond";
  if (why === "far") return `it is moved by at most ${data.joints[joint].prismatic ? `${MOST_WAY * data.task.lengthScale} m` : `${MOST_ANGLE} rad`} at once`;
  const slides = joint !== undefined && data.joints[joint].prismatic;
  const way = slides ? `the rod of ${name} square to its slide` : `the leg of ${name} in line`;
  return `${why} singularity${name && `: ${way}`}`;
}

// Placement of the output.
export function placeOf(data, q) { return frameOf(data.chain.tip, closure(data, q).places); }

// Inputs driven as by `drive`, to the first limit of a joint at most: { q, reached, stop }. With more
// actuators than freedoms the one that moves most leads, and the others follow.
//
// Whole turns of a joint without limits lead to where it is, and are left out.
export function driven(data, wanted, q) {
  const { actuated, metric } = data, { inputs, far } = shortWay(data, wanted, q);
  if (far >= 0) return { q: q.slice(), reached: 0, stop: { why: "far", joint: actuated[far], q: q.slice() } };
  if (actuated.length > data.ranks.mobility) {
    const away = actuated.map((j, k) => Math.abs(inputs[k] - q[j]) / metric[j]), k = away.indexOf(Math.max(...away));
    return ledTo(data, [actuated[k]], [inputs[k]], q);
  }
  return drive(data, inputs, q, bounds(data, q));
}

// The same inputs with less than a turn to go, and which of them is too far (-1: none): of an angle beyond
// MOST_ANGLE the digits say little, and a way is as many steps as it is long.
function shortWay(data, wanted, q) {
  const inputs = data.actuated.map((j, k) => {
    const { prismatic, lower, upper } = data.joints[j], gap = wanted[k] - q[j];
    const free = !prismatic && (lower ?? null) === null && (upper ?? null) === null;
    return free && Math.abs(gap) > TURN ? q[j] + (gap % TURN) : wanted[k];
  });
  const far = data.actuated.findIndex((j, k) => !(Math.abs(wanted[k]) <= MOST_ANGLE || data.joints[j].prismatic) ||
    !(Math.abs(inputs[k] - q[j]) <= MOST_WAY * data.metric[j]));
  return { inputs, far };
}

// How far coordinate k of the pose goes from a closed q, the others held: { lower, upper, whole, below,
// above (why it ends), points }: where the sign of type 2 changes on the way.
export function poseStretch(data, q, k, reach) {
  const row = data.pose.rows[k], here = poseOf(data, placeOf(data, q)), turns = row > 2;
  // Pitch beyond a quarter of a turn is another roll and yaw.
  const most = row === 4 && data.pose.turn.kind !== "axis" ? Math.PI / 2 - 1e-6 : Math.PI;
  const ends = turns && most < 3 ? [-most, most] : turns ? [here[k] - Math.PI, here[k] + Math.PI] : [here[k] - 4 * reach, here[k] + 4 * reach];
  const points = [], sides = ends.map((end) => walked(data, q, here, k, end, points));
  const [below, above] = sides, whole = turns && most > 3 && !below.stop && !above.stop;
  return { lower: below.value, upper: above.value, whole, below: below.stop, above: above.stop, points: points.sort((a, b) => a.value - b.value) };
}

// Step by step to one side, so that each is a small one, and crossings of type 2 are seen.
function walked(data, q, here, k, end, points) {
  const stride = (data.pose.rows[k] < 3 ? data.task.lengthScale : 1) * 0.1, count = Math.max(1, Math.ceil(Math.abs(end - here[k]) / stride));
  const goal = (value) => here.map((v, i) => (i === k ? value : v));
  // The last pose whose sign is more than rounding: on a crossing, and where all is singular, it is not.
  const signed = (at, value) => (data.assembly && motions(data, at).two > data.judge.rtol ? { q: at, value, sign: assemblyValue(data, at) } : null);
  let at = q, value = here[k], clear = signed(q, value);
  for (let n = 1; n <= count; n++) {
    const next = here[k] + ((end - here[k]) * n) / count, found = posed(data, goal(next), at);
    at = found.q;
    value += found.reached * (next - value);
    const now = signed(at, value);
    if (now && clear && now.sign * clear.sign < 0) points.push({ kind: "type 2", ...crossing(data, goal, clear, value) });
    clear = now ?? clear;
    if (found.stop) return { value, stop: found.stop };
  }
  return { value, stop: null };
}

function crossing(data, goal, { q, value, sign }, beyond) {
  let low = value, high = beyond;
  for (let n = 0; n < 40 && Math.abs(high - low) > 1e-10; n++) {
    const middle = (low + high) / 2, found = posed(data, goal(middle), q);
    if (found.reached < 1) break;
    if (assemblyValue(data, found.q) * sign > 0) { low = middle; q = found.q; } else high = middle;
  }
  return { value: (low + high) / 2, q };
}

// Newton from anywhere to the pose: { q, error }.
export const heldPose = (data, goal, start) => newton(data.metric, start, everyJoint(data), (q) => system(data, q, goal), 40);

// Greatest difference of the led coordinates of two configurations, without units.
export function poseGap(data, a, b) {
  const [p, r] = [a, b].map((q) => poseOf(data, placeOf(data, q)));
  return worst(data.pose.rows.map((row, k) => (row < 3 ? (p[k] - r[k]) / data.task.lengthScale : shortest(p[k] - r[k]))));
}
