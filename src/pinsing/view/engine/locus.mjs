// Where an equation is zero over two joints, the others held.

import { apart, bisect } from "./families.mjs";
import { evaluate, freeOf } from "./sums.mjs";

const BISECTED = 16; // times, a side of a square

// The branch of a family that q is nearest to by its joint values, with the joints of its equation;
// null where none has a single equation in two joints or more.
export function curveBranch(family, q, joints) {
  let best = null, least = Infinity;
  for (const branch of family.branches) {
    if (branch.equations.length !== 1) continue;
    const involved = freeOf(branch, q.length).flatMap((on, j) => (on ? [j] : []));
    const off = branch.values.reduce((sum, v) => sum + Math.abs(apart(q[v.joint], v.value, joints[v.joint].prismatic)), 0);
    if (involved.length >= 2 && off < least) { least = off; best = { equation: branch.equations[0], involved, values: branch.values }; }
  }
  return best;
}

// Segments [[a, b], [c, d]] of the curve over joint i in `across` and joint j in `up`, each [from, to]:
// squares of a grid whose corners differ in sign.
export function locus(equation, q, i, j, across, up, steps = 72) {
  const x = q.slice(), at = (u, v) => { x[i] = u; x[j] = v; return evaluate(equation, x).value; };
  const place = ([from, to], k) => from + ((to - from) * k) / steps;
  const grid = [...Array(steps + 1).keys()].map((a) =>
    [...Array(steps + 1).keys()].map((b) => at(place(across, a), place(up, b))));
  const out = [];
  for (let a = 0; a < steps; a++) for (let b = 0; b < steps; b++) {
    const corners = [[a, b], [a + 1, b], [a + 1, b + 1], [a, b + 1]], ends = [];
    corners.forEach(([c, d], k) => {
      const [e, f] = corners[(k + 1) % 4], one = grid[c][d];
      if (one < 0 === grid[e][f] < 0) return;
      const on = (t) => [place(across, c + t * (e - c)), place(up, d + t * (f - d))];
      ends.push(on(bisect((t) => at(...on(t)), 0, 1, one, BISECTED)));
    });
    if (ends.length === 2) out.push(ends);
    else if (ends.length === 4) {
      // A saddle: which corners belong together is what the middle says.
      const middle = at((place(across, a) + place(across, a + 1)) / 2, (place(up, b) + place(up, b + 1)) / 2);
      const same = middle < 0 === grid[a][b] < 0;
      out.push(same ? [ends[0], ends[1]] : [ends[3], ends[0]], same ? [ends[2], ends[3]] : [ends[1], ends[2]]);
    }
  }
  return out;
}
