// Joint positions out of a CSV text: names in the first line, in any order, or none at all. Fewer files than
// `pinsing check` reads, and none in another way.

import { inDegrees } from "./limits.mjs";

const TIME = /^(t|time|stamp|timestamp|seconds)([ _.([]|$)/i;
export const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i;
const NO_NUMBER = /^[-+]?(nan|inf|infinity)$/i;
const UNITS = /^\s*#\s*(angle[\s_]+)?units?\s*[:=](?!\s*rad(ians?)?\s*$)|^\s*#.*((\b|_)deg(rees?)?\b|°)(?!\/)/i;
export const HUGE = 1e6; // radians and metres: beyond it the digits of an angle are gone

// Lines that say something, each with its number in the file, split at what its first one is split at.
function cellsOf(text) {
  const every = text.split(/\r\n|\r|\n/), said = every.findIndex((line) => UNITS.test(line));
  if (said >= 0) throw new Error(`line ${said + 1}: units other than radians`);
  const lines = every.map((line, i) => [line, i + 1]).filter(([line]) => line.trim() && !line.trim().startsWith("#"));
  if (!lines.length) throw new Error("the file is empty");
  const mark = ["\t", ";", ","].find((c) => lines[0][0].includes(c)) ?? ",";
  return lines.map(([line, at]) => [line.split(mark).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1")), at]);
}

// Rows (n each) in the order of `joints`, radians and metres.
export function parseTrajectory(text, joints) {
  if (text.includes("\0")) throw new Error("the file is no text");
  const lines = cellsOf(text), [head] = lines[0];
  let columns = joints.map((_, j) => j), first = 0, clock = -1;
  if (head.some((cell) => /[a-z]/i.test(cell) && !NUMBER.test(cell) && !NO_NUMBER.test(cell))) {
    first = 1;
    columns = joints.map(({ name }) => head.indexOf(name));
    clock = head.findIndex((cell, c) => TIME.test(cell) && !columns.includes(c));
    const lacking = joints.filter((_, j) => columns[j] < 0).map(({ name }) => name);
    if (lacking.length) throw new Error(`no column for ${lacking.join(", ")}`);
    const twice = joints.find(({ name }) => head.indexOf(name) !== head.lastIndexOf(name));
    if (twice) throw new Error(`two columns for ${twice.name}`);
  } else if (head.length === joints.length + 1) { // a time before
    const ascends = (c) => lines.length > 1 && lines.every(([cells], k) => !k || Number(cells[c]) > Number(lines[k - 1][0][c]));
    if (!ascends(0) || ascends(joints.length)) throw new Error(`${head.length} columns without names for ${joints.length} joints: which is time is unclear`);
    columns = columns.map((j) => j + 1);
  } else if (head.length !== joints.length) throw new Error(`${head.length} columns for ${joints.length} joints`);
  let last = -Infinity;
  const rows = lines.slice(first).map(([cells, at]) => {
    if (cells.length !== head.length) throw new Error(`line ${at}: ${cells.length} values for ${head.length} columns`);
    const time = clock < 0 || !NUMBER.test(cells[clock]) ? last : Number(cells[clock]);
    if (time < last) throw new Error(`line ${at}: time runs backwards, from ${last} to ${time}`);
    last = time;
    return columns.map((c, j) => {
      const value = Number(cells[c]);
      if (!NUMBER.test(cells[c]) || !Number.isFinite(value)) throw new Error(`line ${at}: ${cells[c] || "nothing"} is not a number`);
      if (Math.abs(value) > HUGE) throw new Error(`line ${at}: ${cells[c]} is too large (radians and metres, up to 1e6)`);
      if (inDegrees(joints[j], value)) throw new Error(`line ${at}: ${joints[j].name} = ${cells[c]} makes sense in degrees only: write radians`);
      return value;
    });
  });
  if (!rows.length) throw new Error("the file has no samples");
  return rows;
}
