// Everything that the page shows of an arm at one configuration.
//
// `data` is the "engine" part of the page's JSON: { chain, nominal, task: { rows, lengthScale,
// rank, used, never }, judge: { rtol, nearRtol, size, length, columns }, joints, families, centres,
// sizes }. The verdict is taken at the arm's own scale (`length`, `columns`), sigma at the task's.

import { nearestOf } from "./distance.mjs";
import { outside } from "./limits.mjs";
import { norm, quaternion, subtract, transpose, turnZTo } from "./linear.mjs";
import { causes, missingAt, reasons } from "./lost.mjs";
import { drawnRadii, ellipsoids, flatDirection, measure, tipSpeeds } from "./measures.mjs";

const ON = 1e-7; // radians: closer is on the family
const ALIKE = 2e-6; // radians: bounds no farther apart are one distance
const KNOWN = 50, AT_ONCE = 20000; // AT_ONCE: terms of equations that a frame looks at for its distance
const STRUCTURE = 2e-5; // radians, and share of the arm's length: geometry that is so at every configuration
const BESIDE = 0.2; // radians: a singular configuration farther away does not explain one that is near-singular
const FLAT = 1e-5; // share of the largest semi-axis at which one counts as flat

// Numbers, placements, ellipsoids and words at q (n).
export function frameAt(data, q, families = data.families) {
  const { task, judge, sizes } = data;
  const { places, tip, J, sigma, own, ratio, status } = measure(data, q);
  const zero = status === "near-singular" ? Math.min(3 * ratio, judge.nearRtol) : judge.rtol;
  const largest = Math.max(own.sigma[0], judge.size);
  const rankAt = (tol) => own.sigma.filter((s) => s > tol * largest).length;
  const rank = rankAt(zero), here = nearestFamily(data, q, families);
  // Where axes depend on each other: here, or at the point of a family that this is beside.
  const near = status === "near-singular" && here?.q && here.value < BESIDE;
  const there = near ? measure({ ...data, chain: data.nominal ?? data.chain }, here.q) : { J, own, status };
  const family = here?.on || near ? families.find((f) => f.entry === here.entry) : null;
  const { lost, always, mixed } = missingAt(data, q, { J, own, rank, tip, status, ratio });
  const dependent = there.status === "singular"
    ? causes(there.own.Js, task.used, task.rank, Math.max(1e-8, judge.rtol) * Math.max(there.own.sigma[0], judge.size)) : [];
  return {
    q: q.slice(),
    links: places.map(({ R, t }) => [...t, ...quaternion(R)]),
    tip: tip.t,
    ellipsoids: ellipsoids(J, judge.rtol, (e, kind) => {
      const flat = status === "regular" ? null : flatDirection(e, FLAT);
      return { turn: quaternion(transpose(e.axes)), drawn: drawnRadii(e.radii, sizes[kind], sizes), radii: e.radii, flat: flat && turnZTo(flat) };
    }),
    lost: lost.map((m) => ({
      kind: m.kind, turn: turnZTo(m.direction), at: m.point, words: m.words,
      close: norm(subtract(m.point, tip.t)) <= 1.5 * sizes.reach,
    })),
    always: always.map((m) => m.words), mixed,
    hot: [...new Set(dependent.flat())].sort((a, b) => a - b),
    why: reasons(dependent, data.design ? null : family, there.J, task, Math.min(0.05, Math.max(STRUCTURE, 30 * judge.rtol))),
    status, rank: rankAt(judge.rtol), genericRank: task.rank, sigma, ratio,
    condition: sigma[task.rank - 1] > Math.max(6, q.length) * Number.EPSILON * sigma[0] ? sigma[0] / sigma[task.rank - 1] : Infinity,
    manipulability: sigma.slice(0, task.rank).reduce((a, b) => a * b, 1),
    outside: outside(data, q), notes: notes(data, q, ratio),
    verdict: here, speeds: tipSpeeds(data, J, tip.R),
  };
}

// Nearest family among those that the arm can reach: { entry, lower, value, on, text, q } or null. To bring
// what is found and what is certain together, up to `terms` terms of equations are looked at.
export function nearestFamily(data, q, families = data.families, terms = AT_ONCE) {
  const { joints, task } = data, within = families.filter((f) => f.reachable !== false);
  const { lower: least, best } = nearestOf(data, within, q, terms);
  if (!best) return within.length ? { entry: null, lower: least, least, value: Infinity, on: false, q: null, sure: false,
    text: `at least ${short((least * 180) / Math.PI)}\u00b0 from every family; no point of one was found` } : null;
  const { family, branch, lower, upper: value } = best, on = value <= ON;
  const slides = family.moved.length && family.moved.every((j) => joints[j].prismatic);
  const far = (v) => (slides ? `${short(v * task.lengthScale * 1000)} mm` : `${short((v * 180) / Math.PI)}\u00b0`);
  const place = `${family.name}${data.design ? " of the design" : ""}: ${family.where[branch] ?? family.text}`;
  const sure = on || far(Math.min(lower, least)) === far(value) || value - Math.min(lower, least) <= ALIKE;
  return { entry: family.entry, lower, value, on, q: best.q, least, sure, text: `${on ? "on" : howFar({ lower, value, sure }, least, far)} ${place}` };
}

// The same with more time for it; `before` is what is known already.
export function sharpened(data, q, before, terms) {
  remember(data, before);
  return nearestFamily(data, q, data.families, terms);
}

// A point of a family whose own points are not easily found is a place to begin from.
export function remember(data, { entry, q }) {
  const family = q && data.families.find((f) => f.entry === entry);
  if (family?.confirm) family.points = [q, ...(family.points ?? []).slice(0, KNOWN)];
}

// The distance as far as it is known: what is found is an upper bound, `lower` is certain, and
// `least` is so for the families together.
function howFar({ lower, value, sure }, least, far) {
  const certain = Math.min(lower, least);
  if (sure) return `${far(value)} from`;
  if (certain <= 0) return `at most ${far(value)} from`;
  return least < lower ? `between ${far(certain)} and ${far(value)} from the nearest family; found:` : `between ${far(certain)} and ${far(value)} from`;
}

const short = (v) => (v >= 20 ? v.toFixed(0) : v >= 0.1 ? v.toFixed(1) : String(Number(v.toPrecision(2))));

// Where the rounded numbers of the file hide a singularity.
function notes(data, q, ratio) {
  if (!data.nominal || ratio <= data.judge.rtol) return [];
  const there = measure({ ...data, chain: data.nominal }, q);
  return there.status === "singular"
    ? [`singular if the rounded numbers of the file are made exact (nominal geometry): ratio ${there.ratio.toExponential(1)} there`]
    : [];
}
