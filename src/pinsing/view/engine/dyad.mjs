// Planar loops closed by two links that meet in a pin P (5R, four-bar): all modes in closed form.
//
// `dyad` is { sides: [{ pivot, crank, crankSign, crankLength, crankAngle, pin, pinSign,
// rodLength, rodAngle }] } as in pinsing.loops.loop_forms; crank is null where a rod hangs on a pivot.

import { add, norm, scaled, subtract } from "./linear.mjs";
import { gapOf, wrap } from "./loops.mjs";

const TOUCH = 1e-12;
const unit = (angle) => [Math.cos(angle), Math.sin(angle)];
const turned = (side, q) => (side.crank === null ? 0 : side.crankSign * q[side.crank]);
const endOf = (side, q) =>
  (side.crank === null ? side.pivot : add(side.pivot, scaled(unit(turned(side, q) + side.crankAngle), side.crankLength)));

// P (2) at a closed q (n), along the first side.
export function pinOf({ sides: [side] }, q) {
  return add(endOf(side, q), scaled(unit(turned(side, q) + side.pinSign * q[side.pin] + side.rodAngle), side.rodLength));
}

// All configurations at the inputs of q: two, one at type 2, or none.
export function dyadAssemblies(data, q) {
  const { sides } = data.dyad, ends = sides.map((side) => endOf(side, q)), [d1, d2] = sides.map((s) => s.rodLength);
  const gap = subtract(ends[1], ends[0]), distance = norm(gap);
  const at = (angles) => {
    const out = q.slice();
    sides.forEach((side, k) => { out[side.pin] = side.pinSign * (angles[k] - side.rodAngle - turned(side, q)); });
    return wrap(data, out);
  };
  // Both rods equally long and their ends together: P is free on a circle.
  if (distance <= TOUCH && Math.abs(d1 - d2) <= 1e-12 * d2) return [at([0, 0]), at([Math.PI, Math.PI])];
  const along = (distance ** 2 + d1 ** 2 - d2 ** 2) / (2 * distance);
  let square = d1 ** 2 - along ** 2;
  if (Math.abs(square) <= TOUCH * d1 ** 2) square = 0;
  if (!(square >= 0)) return [];
  const way = scaled(gap, 1 / distance), height = Math.sqrt(square);
  const found = [1, -1].map((side) => {
    const P = add(ends[0], [along * way[0] - side * height * way[1], along * way[1] + side * height * way[0]]);
    return at(ends.map((B) => Math.atan2(P[1] - B[1], P[0] - B[0])));
  });
  return gapOf(data, found[0], found[1]) <= 1e-12 ? found.slice(0, 1) : found;
}

// All configurations that put the pin where it is at q: up to four.
export function workingModes(data, q) {
  const point = pinOf(data.dyad, q);
  const [one, two] = data.dyad.sides.map((side) => legs(side, point));
  return one.flatMap((a) => two.map((b) => wrap(data, q.map((v, j) => b[j] ?? a[j] ?? v))));
}

// Values { joint: angle } of one side that reach a point.
function legs(side, point) {
  const reach = subtract(point, side.pivot), away = Math.atan2(reach[1], reach[0]), far = norm(reach);
  if (side.crank === null) {
    return Math.abs(far - side.rodLength) <= 1e-9 * side.rodLength ? [{ [side.pin]: side.pinSign * (away - side.rodAngle) }] : [];
  }
  const { crankLength: length, rodLength: rod } = side;
  const cosine = far > 0 ? (far ** 2 + length ** 2 - rod ** 2) / (2 * far * length) : Infinity;
  if (Math.abs(cosine) > 1 + TOUCH) return [];
  const bend = Math.acos(Math.min(1, Math.max(-1, cosine)));
  return (bend > 0 ? [bend, -bend] : [0]).map((turn) => {
    const B = add(side.pivot, scaled(unit(away + turn), length)), crank = away + turn - side.crankAngle;
    const rodAngle = Math.atan2(point[1] - B[1], point[0] - B[0]) - side.rodAngle - crank;
    return { [side.crank]: side.crankSign * crank, [side.pin]: side.pinSign * rodAngle };
  });
}
