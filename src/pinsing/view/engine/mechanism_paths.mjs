// Motions to play: into a singular pose of a mechanism, and along the locus that it lies on.

import { add, CLOSED, eased, subtract, worst } from "./linear.mjs";
import { gapOf, gaussNewton, unrolled, wrap } from "./mechanism.mjs";
import { refinePoint, trace } from "./singular_points.mjs";

const FRAMES = 48, FAR = 1, STEP = 0.05, SWING = 0.6, JUMP = 0.35, SHORTEST = 6, REGULAR = 1e-3;

// Configurations from a regular pose to a singular `point` { q, moving }, one input moving: of the two
// ways to come, the one that starts further from all singularities; [] where no input leads out.
export function mechanismInto(data, point) {
  const first = Math.max(point.moving, 0), inputs = data.actuated.map((_, k) => k);
  for (const moving of [first, ...inputs.filter((k) => k !== first)]) {
    const way = wayOut(data, point.q, moving);
    if (!way) continue;
    const closed = eased(way.reverse(), FRAMES).map((row) => gaussNewton(data, row));
    const path = closed.filter(({ error }) => error <= CLOSED).map(({ q }) => q);
    if (!path.length) continue;
    path[path.length - 1] = add(path[path.length - 1], wrap(data, subtract(point.q, path[path.length - 1])));
    return path;
  }
  return [];
}

// Singular configurations, there and back on the locus of a point: another input swings, the one along
// which the pose was found is solved for; [] where the locus cannot be followed. Type 3 is two conditions.
export function mechanismAlong(data, point) {
  const moving = Math.max(point.moving, 0), held = data.actuated.filter((_, k) => k !== moving);
  for (const joint of point.converged === false || point.kind === "type 3" ? [] : held) {
    let path = [point.q];
    for (const sign of [1, -1]) {
      const way = followed(data, point, joint, sign, held);
      if (way.length) path = [...path, ...way, ...way.slice(0, -1).reverse(), point.q];
    }
    if (path.length < SHORTEST) continue;
    // Between them none would be singular exactly.
    const rows = unrolled(data, path);
    return Array.from({ length: FRAMES }, (_, k) => rows[Math.round((k * (path.length - 1)) / FRAMES)]);
  }
  return [];
}

// Rows from q to the most regular configuration to one side; null if there is none.
function wayOut(data, q, moving) {
  let best = REGULAR, found = null;
  for (const way of trace(data, q, moving)?.ways ?? []) {
    const rows = way.map((p) => p.q), measure = way.map((p) => Math.min(p.one, p.two)), end = until(rows, measure);
    if (measure[end] > best) { best = measure[end]; found = rows.slice(0, end + 1); }
  }
  return found;
}

// Sample to begin at: the most regular one before the measure falls again, not too far.
function until(rows, measure) {
  let far = 0;
  for (let k = 1; k < rows.length; k++) {
    if (measure[k] < 0.7 * measure[far] && measure[far] > 0.02) break;
    if (worst(subtract(rows[k], rows[0])) > FAR) break;
    if (measure[k] > measure[far] || far === 0) far = k;
  }
  return far;
}

// Poses on the locus as one input moves away to one side, as far as it goes.
function followed(data, point, joint, sign, held) {
  const out = [];
  let q = point.q, before = q;
  for (let k = 0; k < Math.round(SWING / STEP); k++) {
    // As far on as the last step went; the first one moves the swinging joint alone.
    const guess = add(q, wrap(data, subtract(q, before)));
    guess[joint] = q[joint] + sign * STEP;
    const found = refinePoint(data, guess, point.kind, held);
    if (!found.converged || gapOf(data, found.q, q) > JUMP) break;
    before = q;
    q = found.q;
    out.push(q);
  }
  return out;
}
