// Motions that a configuration cannot produce, in words, and the joint axes that are to blame.
//
// A wrench w with J^T w = 0 needs no joint torque, and no motion of the tip has power against it.
// A pure force through the tip takes a translation away, a pure moment a rotation, a force off the
// tip the motion of a line along itself, any other wrench the motion on a screw.

import { add, beside, combinations, combined, cross, dot, identity, leastNorm, leftWhere, norm, scaled, subtract, svd, times, transpose } from "./linear.mjs";
import { inBase, measure, pointUp, rankOf } from "./measures.mjs";

const ALIGNED = (0.1 * Math.PI) / 180;
const EXACT = 1e-5;

// Lost motions [{ kind, direction, point, pitch, speed, words }] of the span of `basis`, six-vectors
// with translations over the length scale; `tool` is { position, rotation, size, landmarks }.
function lostMotions(basis, J, lengthScale, tool, tol, hardly) {
  if (!basis.length) return [];
  const forces = basis.map((u) => u.slice(0, 3)), moments = basis.map((u) => u.slice(3));
  // Orthonormal coefficients of combinations that have no moment, no force, and of the others.
  const [noMoment, noForce] = [moments, forces].map((part) => leftWhere(part, (s) => s <= tol)), pure = [...noMoment, ...noForce];
  const rest = pure.length ? leftWhere(transpose(pure), (s) => s <= 1e-6) : identity(basis.length);
  // What is left of a pure motion is a semi-axis of its ellipsoid, told with the same number.
  const slowest = (directions, rows) => niceBasis(directions, tool.rotation).map((d) => {
    if (!hardly) return d;
    const near = svd(rows).left.reduce((a, b) => Math.abs(dot(b, d)) > Math.abs(dot(a, d)) ? b : a);
    return norm(cross(near, d)) <= tol ? near : d;
  });
  const columns = [
    ...slowest(noMoment.map((c) => combined(forces, c)), J.slice(0, 3)).map((d) => [...d, 0, 0, 0]),
    ...slowest(noForce.map((c) => combined(moments, c)), J.slice(3)).map((d) => [0, 0, 0, ...d]),
    ...rest.map((c) => combined(basis, c)),
  ];
  return columns.map((u) => describe(u, J, lengthScale, tool, tol, hardly));
}

// Basis of a space of directions: tool axes, base axes, then any.
function niceBasis(vectors, rotation) {
  if (!vectors.length) return [];
  const inside = leftWhere(transpose(vectors), (s, most) => s > 0.5 * most), chosen = [];
  for (const axis of [...transpose(rotation), [1, 0, 0], [0, 1, 0], [0, 0, 1], ...inside]) {
    const off = beside(axis, inside), rest = beside(subtract(axis, off), chosen);
    if (norm(off) > ALIGNED || norm(rest) < 0.1) continue;
    chosen.push(scaled(rest, 1 / norm(rest)));
    if (chosen.length === inside.length) break;
  }
  return chosen;
}

function describe(u, J, L, tool, tol, hardly) {
  const force = scaled(u.slice(0, 3), 1 / L), moment = u.slice(3), strength = norm(force);
  const isMoment = strength * L <= tol;
  const w = scaled([...force, ...moment], 1 / (isMoment ? norm(moment) : strength));
  const f = w.slice(0, 3), m = w.slice(3);
  let kind = "rotation", direction = m, point = tool.position, pitch = Infinity;
  if (!isMoment) {
    pitch = dot(f, m);
    const lever = cross(f, m), throughTip = norm(lever) <= tol * tool.size;
    point = throughTip ? tool.position : add(tool.position, lever);
    direction = f;
    if (Math.abs(pitch) > tol * tool.size) kind = "screw";
    else { kind = throughTip ? "translation" : "line"; pitch = 0; }
  }
  direction = pointUp(direction);
  const speed = norm(times(transpose(J), w));
  const [verb, where] = say(kind, direction, point, pitch, tool, tol);
  const words = hardly
    ? `nearly loses ${NOUNS[verb]} ${where} (${general(speed, 4)} ${kind === "rotation" ? "rad/s" : "m/s"} at unit joint speed)`
    : `cannot ${verb} ${where}`;
  return { kind, direction, point, pitch, speed, words };
}

const NOUNS = { translate: "translation", rotate: "rotation", move: "motion" };

// What is lost, as a verb, and where.
function say(kind, direction, point, pitch, tool, tol) {
  if (kind === "translation") return ["translate", `along ${axisName(direction, tool.rotation)}`];
  if (kind === "rotation") return ["rotate", `about ${axisName(direction, tool.rotation)}`];
  const where = line(direction, point, tool, tol);
  if (kind === "line") return ["move", `along the line ${where}`];
  return ["move", `on the screw of pitch ${general(pitch, 3)} m/rad about the line ${where}`];
}

function line(direction, point, tool, tol) {
  const on = tool.landmarks.filter(({ at }) => norm(cross(direction, subtract(at, point))) <= 10 * tol * tool.size);
  if (on.length > 1) return `through ${on[0].name} and ${on[1].name}`;
  const through = on.length ? `${on[0].name} ${vector(on[0].at)} m` : `${vector(point)} m`;
  const base = aligned(direction);
  return `through ${through} in direction ${base ? `base ${base}` : `${vector(direction)} of the base`}`;
}

function axisName(direction, rotation) {
  const inTool = times(transpose(rotation), direction), tool = aligned(inTool), base = aligned(direction);
  if (tool && base) return `tool ${tool} (base ${base})`;
  if (tool || base) return tool ? `tool ${tool}` : `base ${base}`;
  return `${vector(inTool)} of the tool`;
}

function aligned(d) {
  let k = 0;
  for (let i = 1; i < 3; i++) if (Math.abs(d[i]) > Math.abs(d[k])) k = i;
  return norm(d.filter((_, i) => i !== k)) <= Math.sin(ALIGNED) ? "xyz"[k] : "";
}

// A number as Python's "%.3g" has it.
export function general(x, digits) {
  if (x === 0 || !Number.isFinite(x)) return String(x);
  const exponent = Math.floor(Math.log10(Math.abs(Number(x.toPrecision(digits)))));
  if (exponent >= -4 && exponent < digits) return String(Number(x.toPrecision(digits)));
  const [mantissa, power] = x.toExponential(digits - 1).split("e");
  return `${Number(mantissa)}e${power[0]}${power.slice(1).padStart(2, "0")}`;
}

export const vector = (v) => `(${v.map((x) => (Math.abs(x) < 5e-4 ? 0 : x).toFixed(3)).join(", ")})`;

// Sets of joints that force the loss of rank, one for each rank lost, smallest first.
//
// A set S alone forces it when |S| - rank(S) exceeds what the arm can spare in general.
export function causes(Js, used, rank, zero) {
  const columns = transpose(Js), spare = used.length - rank;
  const nullity = (ids) => ids.length - rankOf(ids.map((i) => columns[i]), zero);
  const lost = rank - rankOf(used.map((i) => columns[i]), zero), found = [];
  for (let size = 1; size <= used.length && found.length < lost; size++) {
    for (const ids of combinations(used, size)) {
      if (nullity(ids) < spare + 1) continue;
      const union = [...new Set([...ids, ...found.flat()])].sort((a, b) => a - b);
      if (nullity(union) - spare > found.length) found.push(ids);
      if (found.length >= lost) break;
    }
  }
  return found;
}

// Point where axes of a Jacobian (revolute columns `ids`) come nearest to each other.
export function meetingPoint(J, ids, tip) {
  const A = [[0, 0, 0], [0, 0, 0], [0, 0, 0]], b = [0, 0, 0];
  for (const i of ids) {
    const w = [J[3][i], J[4][i], J[5][i]], v = [J[0][i], J[1][i], J[2][i]], w2 = dot(w, w);
    const foot = add(tip, scaled(cross(w, v), 1 / w2)); // the tip moves with v = w x (tip - foot)
    for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++) {
      const P = (r === c ? 1 : 0) - (w[r] * w[c]) / w2;
      A[r][c] += P;
      b[r] += P * foot[c];
    }
  }
  return leastNorm(A, b, 1e-9);
}

const STEP = 1e-5; // radians (metres over the length scale): of a difference quotient

// { lost, always, mixed } at q, each motion as from lostMotions: `own` is the decomposition at the arm's own
// scale, of this rank. Where those lost cannot be told from those missing everywhere, all are in `lost`, and
// `mixed` says how many of them are missing everywhere.
export function missingAt(data, q, { J, own, rank, tip, status, ratio }) {
  const { task } = data, hardly = status === "near-singular";
  const describe = (rows, nearly, tol) => lostMotions(rows.map((u) => inBase(u, task, tip.R)), J, data.judge.length,
    { position: tip.t, rotation: tip.R, size: sizeOf(J), landmarks: landmarks(data, J, tip.t) }, tol, nearly);
  const said = (lost, always, mixed = 0) => ({
    lost: describe(lost, hardly, hardly ? Math.max(EXACT, Math.min(3 * ratio, 0.05)) : EXACT),
    always: describe(always, false, EXACT), mixed,
  });
  // Directions that the arm can produce nowhere, in task rows.
  const never = task.never.map((u) => task.rows.map((r) => u[r]));
  if (status !== "singular") return said(own.left.slice(rank, task.rank), own.left.slice(task.rank));
  const missing = without(own.left.slice(rank), never), more = missing.length - (task.rank - rank);
  if (more <= 0) return said(missing, never);
  const fresh = regained(data, q, own, missing, rank);
  return fresh.length === task.rank - rank ? said(fresh, [...without(missing, fresh), ...never]) : said(missing, never, more);
}

// What of the missing directions comes back where q is left, whichever way: with w missing and z a motion of
// the joints that leaves the task at rest, w . dJ z is how fast. Those of other arms stay missing.
function regained(data, q, own, missing, rank) {
  const still = svd(transpose(own.Js)).left.slice(rank), columns = [];
  q.forEach((_, k) => {
    const step = STEP * (data.joints[k].prismatic ? data.task.lengthScale : 1);
    const [up, down] = [step, -step].map((h) => measure(data, q.map((v, j) => (j === k ? v + h : v))).own.Js);
    for (const z of still) columns.push(missing.map((w) => up.reduce((sum, row, i) => sum + (w[i] * (dot(row, z) - dot(down[i], z))) / (2 * step), 0)));
  });
  if (!columns.length) return [];
  return leftWhere(transpose(columns), (s, most) => s > 1e-6 * Math.max(most, 1e-6)).map((c) => combined(missing, c));
}

// Orthonormal basis of what is left of some vectors beside orthonormal others.
function without(vectors, others) {
  const rest = vectors.map((u) => beside(u, others));
  return rest.length ? leftWhere(transpose(rest), (s) => s > 0.5) : [];
}

// Greatest speed of the tip at unit speed of one turning joint: how long the arm is, metres.
function sizeOf(J) {
  let most = 0;
  J[0].forEach((_, i) => {
    if (J[3][i] || J[4][i] || J[5][i]) most = Math.max(most, Math.hypot(J[0][i], J[1][i], J[2][i]));
  });
  return most || 1;
}

const landmarks = (data, J, tip) =>
  data.centres.map(({ name, joints }) => ({ name: `the ${name}`, at: meetingPoint(J, joints, tip) }));

// Why joint axes depend on each other, at the configuration shown or the singular one beside it.
//
// Five independent twists leave one wrench that none of them works against. Where its pitch is zero
// all turning axes meet its line or are parallel to it; any other pitch makes them members of one
// linear complex of that pitch (K. H. Hunt, "Kinematic Geometry of Mechanisms", 1978). The pitch
// changes from pose to pose of a family, so that it cannot come with the family's text.

const COUNTS = { 5: "five ", 6: "six ", 7: "seven " };
const COMPLEX = "linear complex";

// One sentence for each dependent set of joints (from 0). `family` is that which the configuration of J
// is on, or null; `tol` is in radians, and a share of the arm's length.
export function reasons(dependent, family, J, task, tol) {
  const told = family?.reason && dependent.length === 1 ? family.reason : "";
  if (told && !told.includes(COMPLEX)) return [told];
  return dependent.map((ids) => ids.length === 1 ? `joint ${ids[0] + 1} does not move the task`
    : (task.rows.length === 6 && commonWrench(J, ids, tol))
      || `joints ${list(ids)} can move together with the ${task.rows.length === 6 ? "tip" : "task"} at rest`);
}

function commonWrench(J, ids, tol) {
  const columns = transpose(J), axis = (i) => columns[i].slice(3), speed = (i) => columns[i].slice(0, 3);
  const turns = (i) => norm(axis(i)) > 0;
  // A joint that drives others as well has no axis of its own.
  if (!ids.every((i) => !turns(i) || (Math.abs(norm(axis(i)) - 1) < 1e-9 && Math.abs(dot(axis(i), speed(i))) < 1e-9))) return "";
  const size = Math.max(...columns.map((c, i) => (turns(i) ? norm(speed(i)) : 0))) || 1;
  const twists = ids.map((i) => [...scaled(speed(i), turns(i) ? 1 / size : 1), ...axis(i)]);
  const { sigma, left } = svd(transpose(twists));
  if (sigma.length < 6 || sigma.filter((s) => s > tol * sigma[0]).length !== 5) return "";
  const force = left[5].slice(0, 3), moment = left[5].slice(3), strength = norm(force);
  const turning = ids.filter(turns), sliding = ids.filter((i) => !turns(i));
  if (strength <= tol) return `axes ${list(turning)} are parallel to one plane`;
  const pitch = dot(force, moment) / strength ** 2;
  if (Math.abs(pitch) <= tol) {
    const along = turning.filter((i) => norm(cross(axis(i), force)) <= tol * strength);
    return commonLine(columns.length, turning.filter((i) => !along.includes(i)), along, sliding);
  }
  const who = turning.length === columns.length ? `all ${COUNTS[turning.length] ?? ""}axes` : `axes ${list(turning)}`;
  return `${who} belong to one ${COMPLEX}, here of pitch ${general(pitch * size, 3)} m/rad${across(sliding, "its axis")}`;
}

function commonLine(count, met, along, sliding) {
  if (!met.length) return "";
  const verb = met.length === 1 ? "meets" : "meet";
  const words = [`${met.length === count ? "all axes" : counted("axis", "axes", met)} ${verb} a common line`];
  if (along.length) words.push(`${counted("axis", "axes", along)} ${are(along)} parallel to it`);
  if (sliding.length) words.push(`${counted("prismatic joint", "prismatic joints", sliding)} ${are(sliding)} perpendicular to it`);
  const last = words.pop();
  return words.length ? `${words.join(", ")}, and ${last}` : last;
}

const across = (sliding, what) => sliding.length
  ? `, and ${counted("prismatic joint", "prismatic joints", sliding)} ${are(sliding)} perpendicular to ${what}` : "";
const are = (ids) => (ids.length === 1 ? "is" : "are");
const counted = (one, many, ids) => `${ids.length === 1 ? one : many} ${list(ids)}`;

const list = (ids) => listed(ids.map((i) => i + 1));

// "a, b and c".
export const listed = (words) => (words.length === 1 ? String(words[0]) : `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`);
