// Everything that the page shows of a mechanism at one closed configuration.

import { outside } from "./limits.mjs";
import { add, combined, cross, dot, norm, quaternion, scaled, subtract, svd, transpose, turnZTo } from "./linear.mjs";
import { listed, vector } from "./lost.mjs";
import { drawnRadii, ellipsoids, inBase } from "./measures.mjs";
import { stateAt } from "./mechanism.mjs";
import { poseOf } from "./pose_drive.mjs";

const LONGEST = 0.6; // of the mechanism: towards type 2 ellipses grow without end
const MOVES = 1e-6, CLOSE = 1.5, ARROWS = 3;
const LOCKED = { "type 2": () => "the actuators are locked", "type 1": (o) => `${o} is locked`, "type 3": (o) => `${o} or the actuators are locked` };
const SAYS = {
  "type 1": "a direction of the output is lost", "type 2": "the output moves with the actuators locked",
  "type 3": "a direction is lost, and the output moves with the actuators locked",
  constraint: "the linkage gains a motion: its loops hold less than elsewhere",
};

// Placements, ellipses, measures and words at a closed q (n); keys as of frameAt, with `kind`, `mode`, the
// measures `one`, `two`, `constraint`, and `free`: arrows of what moves with the actuators at rest.
export function mechanismFrame(data, q) {
  const state = stateAt(data, q), at = state.place.t;
  const lost = ["regular", "type 2"].includes(state.kind) ? [] : state.lost.map((u) => lostOf(data, at, u));
  const free = ["regular", "type 1"].includes(state.kind) ? [] : state.uncontrolled.map((v) => looseOf(data, at, v));
  const hot = movingJoints(data, state), regular = state.kind === "regular";
  const sigma = regular && state.velocity ? speeds(data, state.velocity) : [];
  return {
    q: q.slice(), links: state.places.map(({ R, t }) => [...t, ...quaternion(R)]), tip: at,
    pose: poseOf(data, state.place), ellipsoids: ellipses(data, state, lost),
    lost: lost.slice(0, ARROWS).map((m) => lineOf(data, m, at)), free: arrows(data, free, at),
    given: free.map((m) => m.words), hot, why: why(data, state, hot),
    status: regular ? (state.near ? "near-singular" : "regular") : "singular", kind: state.kind, mode: state.mode,
    one: state.one, two: state.two, constraint: state.constraint,
    condition: sigma.length && sigma[sigma.length - 1] > 0 ? sigma[0] / sigma[sigma.length - 1] : Infinity,
    gain: state.velocity ? svd(state.velocity).sigma[0] : Infinity,
    outside: outside(data, q),
    notes: [], verdict: { text: verdict(state) }, refused: null,
  };
}

// Output speeds at unit input speed, lengths over the length scale.
function speeds(data, velocity) {
  const L = data.task.lengthScale, found = svd(velocity.map((row, i) => (data.task.rows[i] < 3 ? scaled(row, 1 / L) : row)));
  return found.sigma.slice(0, Math.min(found.sigma.length, data.actuated.length));
}

function verdict(state) {
  if (state.kind !== "regular") return SAYS[state.kind];
  if (!state.near) return "";
  const [name, value] = [["type 1", state.one], ["type 2", state.two], ["a constraint singularity", state.constraint]]
    .reduce((a, b) => (b[1] < a[1] ? b : a));
  return `close to ${name} (measure ${Number(value.toPrecision(1))})`;
}

// Joints that move in the singular motion: with the actuators, or the output, at rest.
function movingJoints(data, { kind, basis, inputs, outputs }) {
  const hot = new Set();
  for (const [name, rows] of [["type 1", outputs], ["type 2", inputs]]) {
    if (kind !== name && kind !== "type 3") continue;
    const { left } = svd(transpose(rows));
    combined(basis, left[left.length - 1]).forEach((v, j) => { if (Math.abs(v) > MOVES) hot.add(j); });
  }
  return [...hot].sort((a, b) => a - b);
}

function why(data, { kind }, hot) {
  const names = hot.map((j) => data.joints[j].name);
  if (!names.length) return [];
  return [`${listed(names)} can move although ${LOCKED[kind](data.output)}`];
}

function ellipses(data, state, lost) {
  const { sizes, normal } = data, J = Array.from({ length: 6 }, () => data.actuated.map(() => 0));
  if (state.velocity) data.task.rows.forEach((r, i) => { J[r] = state.velocity[i]; });
  return ellipsoids(J, data.judge.rtol, (e, kind, pure) => {
    const scale = sizes[kind], radii = e.radii.map((r) => Math.min(r, (LONGEST * sizes.reach) / scale));
    let shown = drawnRadii(radii, scale, sizes);
    const ring = kind === "rotation" && normal !== null;
    if (ring) shown = [shown[0], shown[0], shown[0]];
    const flat = flatOf(lost, kind, pure);
    return { turn: ring ? turnZTo(normal) : quaternion(transpose(e.axes)), drawn: shown, radii: e.radii, flat: flat && turnZTo(flat) };
  });
}

// Direction in which an ellipse is flat: of the only lost motion, if it has such a part.
function flatOf(lost, kind, pure) {
  if (lost.length !== 1) return null;
  const { force, moment } = lost[0], [part, other] = kind === "translation" ? [force, moment] : [moment, force];
  // Together with the other part every motion of this one may still be there.
  if (norm(part) <= MOVES || (!pure && norm(other) > MOVES)) return null;
  return scaled(part, 1 / norm(part));
}

function lineOf(data, m, tip) {
  const { reach } = data.sizes, way = norm(m.force) > 0 ? m.force : m.moment;
  const onTip = m.line === null || norm(subtract(m.line, tip)) <= MOVES * reach;
  return { kind: onTip ? "direction" : "line", turn: turnZTo(scaled(way, 1 / norm(way))), at: m.line ?? tip, words: m.words,
           close: m.line === null || norm(subtract(m.line, tip)) <= CLOSE * reach };
}

// Where the arrows of what moves by itself go: along it, and about the axis of a turn.
function arrows(data, free, tip) {
  const out = { translation: null, rotation: null }, { reach } = data.sizes;
  for (const { velocity, turning, centre } of free.slice(0, 1)) {
    const speed = norm(velocity), turns = norm(turning) > 0;
    if (speed > MOVES && (!turns || speed > MOVES * reach)) out.translation = { at: tip, turn: turnZTo(scaled(velocity, 1 / speed)) };
    if (turns && centre && norm(subtract(centre, tip)) <= CLOSE * reach) {
      out.rotation = { at: centre, turn: turnZTo(scaled(turning, 1 / Math.sqrt(dot(turning, turning)))) };
    }
  }
  return out;
}

const SMALL = 1e-6;

// Output motion that no input speed brings about, by its unit wrench { force, moment, line, words }.
export function lostOf(data, at, direction) {
  const name = data.output;
  let { head: force, tail: moment } = spread(data, direction, 1 / data.task.lengthScale);
  const size = norm(force);
  if (size <= SMALL) {
    const axis = unit(moment);
    return { force: [0, 0, 0], moment: axis, line: null, words: `${name} cannot turn about ${axisText(axis)}` };
  }
  force = scaled(force, 1 / size);
  moment = scaled(moment, 1 / size);
  if (norm(moment) <= SMALL) return { force, moment: [0, 0, 0], line: at, words: `${name} cannot move along ${axisText(force)}` };
  if (Math.abs(dot(force, moment)) > SMALL) return { force, moment, line: null, words: `a screw of ${name} about ${axisText(force)} is lost` };
  const line = add(at, cross(force, moment));
  return { force, moment, line, words: `${name}'s link cannot move along the line through ${vector(line)} m in direction ${axisText(force)}` };
}

// Output motion with all actuators at rest: { velocity, turning, centre, words }, of the output frame.
export function looseOf(data, at, column) {
  const name = data.output, locked = "with the actuators locked";
  let { head: velocity, tail: turning } = spread(data, column, data.task.lengthScale);
  const rate = norm(turning);
  if (rate <= SMALL * Math.max(norm(velocity), 1)) {
    const still = norm(velocity) <= SMALL, way = unit(velocity);
    return { velocity: still ? [0, 0, 0] : way, turning: [0, 0, 0], centre: null,
             words: still ? `${name} stays, but the linkage moves ${locked}` : `${name} gives way along ${axisText(way)} ${locked}` };
  }
  velocity = scaled(velocity, 1 / rate);
  turning = scaled(turning, 1 / rate);
  if (Math.abs(dot(velocity, turning)) > SMALL) return { velocity, turning, centre: null, words: `${name} screws about ${axisText(turning)} ${locked}` };
  const centre = add(at, cross(turning, velocity)), where = data.task.rows.some((r) => r < 3) ? ` through ${vector(centre)} m` : "";
  return { velocity, turning, centre, words: `${name} turns about ${axisText(turning)}${where} ${locked}` };
}

// Translation and rotation part of a column over the task rows; the former by `length`.
function spread(data, column, length) {
  const full = inBase(column, data.task);
  return { head: scaled(full.slice(0, 3), length), tail: full.slice(3) };
}

const unit = (v) => (norm(v) > 0 ? scaled(v, 1 / norm(v)) : v);

// "x", or components; either sense of a line is the same.
function axisText(way) {
  const sizes = way.map((v) => Math.round(Math.abs(v) * 1e6)), k = sizes.indexOf(Math.max(...sizes));
  const d = scaled(way, Math.sign(way[k]) || 1);
  const axis = [0, 1, 2].find((i) => d.every((v, j) => Math.abs(v - (i === j ? 1 : 0)) <= SMALL));
  return axis === undefined ? vector(d) : "xyz"[axis];
}
