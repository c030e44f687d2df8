// Why joint axes depend on each other, in words that hold at the configuration shown.
//
// Five independent twists leave one wrench that none of them works against. Where its pitch is zero
// all turning axes meet its line or are parallel to it; any other pitch makes them members of one
// linear complex of that pitch (K. H. Hunt, "Kinematic Geometry of Mechanisms", 1978). The pitch
// changes from pose to pose of a family, so that it cannot come with the family's text.

import { cross, dot, norm, scaled, svd, transpose } from "./linear.mjs";
import { general } from "./lost.mjs";

const COUNTS = { 5: "five ", 6: "six ", 7: "seven " };
const COMPLEX = "linear complex";

// One sentence for each dependent set of joints (from 0). `family` is that which the configuration
// is on, or null; `tol` is in radians, and a share of the arm's length.
export function reasons(dependent, family, J, task, tol, nearly = "") {
  const told = family?.reason && dependent.length === 1 ? family.reason : "";
  if (told && !told.includes(COMPLEX)) return [told];
  return dependent.map((ids) => ids.length === 1 ? `joint ${ids[0] + 1} does not move the task`
    : (task.rows.length === 6 && commonWrench(J, ids, tol, nearly))
      || `joints ${list(ids)} can move together with the ${task.rows.length === 6 ? "tip" : "task"} ${nearly}at rest`);
}

function commonWrench(J, ids, tol, nearly) {
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
  if (strength <= tol) return `axes ${list(turning)} are ${nearly}parallel to one plane`;
  const pitch = dot(force, moment) / strength ** 2;
  if (Math.abs(pitch) <= tol) {
    const along = turning.filter((i) => norm(cross(axis(i), force)) <= tol * strength);
    return commonLine(columns.length, turning.filter((i) => !along.includes(i)), along, sliding, nearly);
  }
  const who = turning.length === columns.length ? `all ${COUNTS[turning.length] ?? ""}axes` : `axes ${list(turning)}`;
  return `${who} ${nearly}belong to one ${COMPLEX}, here of pitch ${general(pitch * size, 3)} m/rad${across(sliding, nearly, "its axis")}`;
}

function commonLine(count, met, along, sliding, nearly) {
  if (!met.length) return "";
  const verb = met.length === 1 ? "meets" : "meet";
  const words = [`${met.length === count ? "all axes" : counted("axis", "axes", met)} ${nearly}${verb} a common line`];
  if (along.length) words.push(`${counted("axis", "axes", along)} ${are(along)} ${nearly}parallel to it`);
  if (sliding.length) words.push(`${counted("prismatic joint", "prismatic joints", sliding)} ${are(sliding)} ${nearly}perpendicular to it`);
  const last = words.pop();
  return words.length ? `${words.join(", ")}, and ${last}` : last;
}

const across = (sliding, nearly, what) => sliding.length
  ? `, and ${counted("prismatic joint", "prismatic joints", sliding)} ${are(sliding)} ${nearly}perpendicular to ${what}` : "";
const are = (ids) => (ids.length === 1 ? "is" : "are");
const counted = (one, many, ids) => `${ids.length === 1 ? one : many} ${list(ids)}`;

function list(ids) {
  const words = ids.map((i) => i + 1);
  return words.length === 1 ? String(words[0]) : `${words.slice(0, -1).join(", ")} and ${words[words.length - 1]}`;
}
