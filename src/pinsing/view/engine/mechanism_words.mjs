// What the output of a mechanism cannot do, or does by itself, in words and as arrows.

import { add, cross, dot, norm, scaled } from "./linear.mjs";

const SMALL = 1e-6;

// Output motion that no input speed brings about, by its unit wrench { force, moment, line, words }.
export function lostOf(data, at, direction) {
  const name = data.output;
  let { head: force, tail: moment } = spread(data, direction, 1 / data.task.lengthScale);
  const size = norm(force);
  if (size <= SMALL) {
    const axis = unit(moment);
    return { force: [0, 0, 0], moment: axis, line: null, words: `${name} cannot turn about ${along(axis)}` };
  }
  force = scaled(force, 1 / size);
  moment = scaled(moment, 1 / size);
  if (norm(moment) <= SMALL) return { force, moment: [0, 0, 0], line: at, words: `${name} cannot move along ${along(force)}` };
  if (Math.abs(dot(force, moment)) > SMALL) return { force, moment, line: null, words: `a screw of ${name} about ${along(force)} is lost` };
  const line = add(at, cross(force, moment));
  return { force, moment, line, words: `${name}'s link cannot move along the line through ${triple(line)} m in direction ${along(force)}` };
}

// Output motion with all actuators at rest: { velocity, turning, centre, words }, of the output frame.
export function freeOf(data, at, column) {
  const name = data.output, locked = "with the actuators locked";
  let { head: velocity, tail: turning } = spread(data, column, data.task.lengthScale);
  const rate = norm(turning);
  if (rate <= SMALL * Math.max(norm(velocity), 1)) {
    const still = norm(velocity) <= SMALL, way = unit(velocity);
    return { velocity: still ? [0, 0, 0] : way, turning: [0, 0, 0], centre: null,
             words: still ? `${name} stays, but the linkage moves ${locked}` : `${name} gives way along ${along(way)} ${locked}` };
  }
  velocity = scaled(velocity, 1 / rate);
  turning = scaled(turning, 1 / rate);
  if (Math.abs(dot(velocity, turning)) > SMALL) return { velocity, turning, centre: null, words: `${name} screws about ${along(turning)} ${locked}` };
  const centre = add(at, cross(turning, velocity)), where = data.task.rows.some((r) => r < 3) ? ` through ${triple(centre)} m` : "";
  return { velocity, turning, centre, words: `${name} turns about ${along(turning)}${where} ${locked}` };
}

// Translation and rotation part of a column over the task rows; the former by `length`.
function spread(data, column, length) {
  const full = [0, 0, 0, 0, 0, 0];
  data.task.rows.forEach((r, i) => { full[r] = column[i]; });
  return { head: scaled(full.slice(0, 3), length), tail: full.slice(3) };
}

const unit = (v) => (norm(v) > 0 ? scaled(v, 1 / norm(v)) : v);

// "x", or components; either sense of a line is the same.
function along(vector) {
  const sizes = vector.map((v) => Math.round(Math.abs(v) * 1e6)), k = sizes.indexOf(Math.max(...sizes));
  const d = scaled(vector, Math.sign(vector[k]) || 1);
  const axis = [0, 1, 2].find((i) => d.every((v, j) => Math.abs(v - (i === j ? 1 : 0)) <= SMALL));
  return axis === undefined ? triple(d) : "xyz"[axis];
}

const triple = (v) => `(${v.map((x) => { const text = x.toFixed(3); return text === "-0.000" ? "0.000" : text; }).join(", ")})`;
