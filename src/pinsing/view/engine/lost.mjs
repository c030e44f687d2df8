// Motions that a configuration cannot produce, in words, and the joint axes that are to blame.
//
// A wrench w with J^T w = 0 needs no joint torque, and no motion of the tip has power against it.
// A pure force through the tip takes a translation away, a pure moment a rotation, a force off the
// tip the motion of a line along itself, any other wrench the motion on a screw.

import { add, cross, dot, identity, norm, scaled, subtract, svd, times, transpose } from "./linear.mjs";
import { pointUp, rankOf } from "./measures.mjs";

const ALIGNED = (0.1 * Math.PI) / 180;
export const EXACT = 1e-5;

// Lost motions [{ kind, direction, point, pitch, speed, words }] of the span of `basis`, six-vectors
// with translations over the length scale; `tool` is { position, rotation, size, landmarks }.
export function lostMotions(basis, J, lengthScale, tool, tol, hardly) {
  if (!basis.length) return [];
  const forces = basis.map((u) => u.slice(0, 3)), moments = basis.map((u) => u.slice(3));
  const noMoment = nullSpace(moments, tol), noForce = nullSpace(forces, tol);
  const rest = complement([...noMoment, ...noForce], basis.length);
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

export const combined = (vectors, c) => vectors.reduce((sum, v, i) => add(sum, scaled(v, c[i])), new Array(vectors[0].length).fill(0));

// Orthonormal coefficients of combinations of the vectors that vanish.
function nullSpace(vectors, tol) {
  const { sigma, left } = svd(vectors);
  return left.filter((_, k) => (sigma[k] ?? 0) <= tol);
}

function complement(vectors, d) {
  if (!vectors.length) return identity(d);
  const { sigma, left } = svd(transpose(vectors));
  return left.filter((_, k) => (sigma[k] ?? 0) <= 1e-6);
}

// Basis of a space of directions: tool axes, base axes, then any.
function niceBasis(vectors, rotation) {
  if (!vectors.length) return [];
  const { sigma, left } = svd(transpose(vectors));
  const inside = left.filter((_, k) => (sigma[k] ?? 0) > 0.5 * sigma[0]), chosen = [];
  for (const axis of [...transpose(rotation), [1, 0, 0], [0, 1, 0], [0, 0, 1], ...inside]) {
    const inner = inside.reduce((sum, d) => add(sum, scaled(d, dot(d, axis))), [0, 0, 0]);
    const rest = chosen.reduce((r, c) => subtract(r, scaled(c, dot(r, c))), inner);
    if (norm(subtract(axis, inner)) > ALIGNED || norm(rest) < 0.1) continue;
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

const vector = (v) => `(${v.map((x) => (Math.abs(x) < 5e-4 ? 0 : x).toFixed(3)).join(", ")})`;

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

function* combinations(items, size, from = 0) {
  if (size === 0) { yield []; return; }
  for (let i = from; i <= items.length - size; i++) {
    for (const rest of combinations(items, size - 1, i + 1)) yield [items[i], ...rest];
  }
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
  const { sigma, left, right } = svd(A);
  let out = [0, 0, 0];
  sigma.forEach((s, k) => { if (s > 1e-9 * sigma[0]) out = add(out, scaled(right[k], dot(left[k], b) / s)); });
  return out;
}

