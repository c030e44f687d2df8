// A mechanism: its closed loops, Newton's way to close them, and what it can do at a closed configuration:
// type of singularity, modes, velocities.
//
// `data` is the "engine" part of a mechanism's page: { chain (its tip is the output), loops:
// [{ kind, a, b }] of frames { parent, R, t }, task: { rows, lengthScale }, metric (what counts as one
// radian, per joint), joints, actuated, ranks: { constraint, mobility, output }, judge, home, assembly,
// balls, elbows, legs, normal, sizes }. Everything below is without units: lengths over the length scale.
//
// With N a basis of the motions that the loops allow, inputs move as S N and the output as J N (S picks
// the actuated joints): type 1 where J N loses rank, type 2 where S N does, type 3 both, a constraint
// singularity where the closure itself does (C. Gosselin and J. Angeles, 1990; D. Zlatanov, R. G. Fenton
// and B. Benhabib, 1995).

import { frameOf, jacobian, placements } from "./chain.mjs";
import { add, CLOSED, cross, determinant, dot, generator, identity, leastNorm, newton, norm, product, rotationVector, scaled, subtract, svd, times, transpose, worst } from "./linear.mjs";

const ROWS = { planar: 2, "3d": 3, "6d": 6 }, FULL = 2 * Math.PI;

// Residual (k) and constraint Jacobian G (k x n) at q (n). Rows of a loop are in the axes of its first
// frame, translations before rotations. `columns`: Jacobian of a frame.
export function closure(data, q, columns = jacobian) {
  const places = placements(data.chain, q), L = data.task.lengthScale, residual = [], G = [];
  for (const { kind, a, b } of data.loops) {
    const A = frameOf(a, places), B = frameOf(b, places), inA = transpose(A.R);
    const Ja = columns(data.chain, places, a), Jb = columns(data.chain, places, b);
    const gap = scaled(times(inA, subtract(B.t, A.t)), 1 / L);
    if (kind === "6d") gap.push(...rotationVector(product(inA, B.R)));
    for (let i = 0; i < ROWS[kind]; i++) {
      const part = i < 3 ? 0 : 3, axis = inA[i - part], unit = i < 3 ? 1 / L : 1;
      residual.push(gap[i]);
      G.push(data.metric.map((m, j) => {
        let sum = 0;
        for (let k = 0; k < 3; k++) sum += axis[k] * (Jb[part + k][j] - Ja[part + k][j]);
        return unit * m * sum;
      }));
    }
  }
  return { residual, G, places };
}

// Task rows of the output (m x n) by all joints.
export function output(data, places, columns = jacobian) {
  const full = columns(data.chain, places, data.chain.tip);
  return data.task.rows.map((r) => full[r].map((x, j) => x * data.metric[j] * (r < 3 ? 1 / data.task.lengthScale : 1)));
}

// Revolute values, or differences of such, within half a turn of zero.
export const wrap = (data, q) =>
  q.map((v, j) => (data.joints[j].prismatic ? v : v - FULL * Math.floor((v + Math.PI) / FULL)));

// Greatest difference of two configurations, whole turns aside, radians and metres.
export const gapOf = (data, a, b) => worst(wrap(data, subtract(a, b)));

// Rows moved by whole turns so that each is beside the one before.
export function unrolled(data, rows) {
  const out = [rows[0]];
  for (let k = 1; k < rows.length; k++) out.push(add(out[k - 1], wrap(data, subtract(rows[k], out[k - 1]))));
  return out;
}

export const everyJoint = (data) => [...data.joints.keys()];
export const passiveOf = (data) => everyJoint(data).filter((j) => !data.actuated.includes(j));

// Rows of a matrix that picks some joints.
export const unitRows = (data, joints) => joints.map((j) => data.joints.map((_, i) => (i === j ? 1 : 0)));

// Close the loops by moving the joints `used` least: { q, error }.
export function gaussNewton(data, start, used = everyJoint(data)) {
  const system = (q) => { const { residual, G } = closure(data, q); return { values: residual, rows: G.map((row) => used.map((j) => row[j])) }; };
  return newton(data.metric, start, used, system, 60);
}

// Closed configurations that random starts lead to; joints that are not `free` stay at `start`.
export function randomClosed(data, count, seed, free = everyJoint(data), start = data.home) {
  const random = generator(seed), out = [];
  for (let k = 0; k < count; k++) {
    const drawn = data.joints.map(({ prismatic }) => (2 * random() - 1) * (prismatic ? data.task.lengthScale : Math.PI));
    const { q, error } = gaussNewton(data, start.map((v, j) => (free.includes(j) ? drawn[j] : v)), free);
    if (error <= CLOSED) out.push(wrap(data, q));
  }
  return out;
}

const POINT = 1e-9; // metres: axes that come closer meet
const STRAIGHT = 1e-9; // sine of an elbow up to which it counts as straight
const OPEN = 1e-6; // loops that miss by more are not closed

const largest = (A) => (A.length ? svd(A).sigma[0] ?? 0 : 0);

// Motions { basis (d vectors), inputs (n_a x d), outputs (m x d), size, constraint, two, one }.
export function motions(data, q, known = closure(data, q)) {
  const found = measured(data, known.G, output(data, known.places));
  const least = Math.min(found.constraint, found.two, found.one);
  if (least > data.judge.nearRtol || !locked(data, known.places)) return found;
  const columns = ballColumns(data);
  const whole = measured(data, closure(data, q, columns).G, output(data, known.places, columns));
  return { ...whole, basis: hingeRates(data, known.places, whole.basis) };
}

// The same from the Jacobians of closure and output.
function measured(data, G, J) {
  const { rtol } = data.judge, { ranks } = data;
  const { sigma, left } = svd(transpose(G)), r = ranks.constraint;
  const constraint = sigma[0] > 0 ? sigma[r - 1] / sigma[0] : 0;
  const basis = left.slice(constraint > rtol ? r : sigma.filter((s) => s > rtol * sigma[0]).length);
  const inputs = data.actuated.map((j) => basis.map((v) => v[j]));
  const outputs = J.map((row) => basis.map((v) => dot(row, v)));
  const size = largest(J), d = basis.length, sigmaIn = svd(inputs).sigma;
  return {
    basis, inputs, outputs, size, constraint,
    two: d <= sigmaIn.length ? sigmaIn[d - 1] : 0,
    one: size > 0 ? svd(outputs).sigma[ranks.output - 1] / size : 0,
  };
}

export function kindOf({ constraint, one, two }, rtol) {
  if (constraint <= rtol) return "constraint";
  return one <= rtol ? (two <= rtol ? "type 3" : "type 1") : two <= rtol ? "type 2" : "regular";
}

// State at a closed q (n): kind, near, mode, measures, places of joints, place of the output, `velocity` of the output per
// unit input speed (m x n_a, metres and radians; null at type 2), directions `lost` and `uncontrolled`
// (m each, without units), and the motions themselves.
export function stateAt(data, q) {
  const { rtol, nearRtol } = data.judge, known = closure(data, q), miss = worst(known.residual);
  if (!(miss <= OPEN)) throw new Error(`the loops miss by ${miss.toPrecision(2)}: close them first`);
  const found = motions(data, q, known), { basis, inputs, outputs } = found, d = basis.length;
  const kind = kindOf(found, rtol), across = svd(outputs), drive = svd(transpose(inputs));
  const reached = across.sigma.filter((s) => s > rtol * found.size).length;
  const controlled = drive.sigma.filter((s) => s > rtol).length;
  return {
    q: q.slice(), ...found, kind, near: kind === "regular" && Math.min(found.constraint, found.one, found.two) <= nearRtol,
    mode: modeOf(data, q), places: known.places, place: frameOf(data.chain.tip, known.places), velocity: controlled === d ? velocityOf(data, found) : null,
    lost: across.left.slice(reached, Math.max(reached, data.ranks.output)),
    uncontrolled: drive.left.slice(controlled).map((v) => times(outputs, v)),
  };
}

// J N (S N)^+ in metres and radians.
function velocityOf({ task, actuated, metric }, { inputs, outputs }) {
  const motions = identity(inputs.length).map((input) => leastNorm(inputs, input));
  return task.rows.map((r, i) => actuated.map((j, a) => (dot(outputs[i], motions[a]) * (r < 3 ? task.lengthScale : 1)) / metric[j]));
}

// Sine of each elbow angle: positive to the left about the crank's axis. Of a leg whose axes meet in one
// point, the volume of their directions; of a slide, the cosine between its rod and it.
export function elbowSines(data, q) {
  const places = placements(data.chain, q), axisOf = (j) => times(places[j].R, data.chain.joints[j].axis);
  return data.elbows.map(({ crank, elbow, endJoint, end, slides }) => {
    const a = places[crank].t, b = places[elbow].t, first = subtract(b, a), second = times(places[endJoint].R, end);
    if (slides) return dot(axisOf(crank), second) / Math.max(norm(second), POINT);
    if (norm(first) <= POINT) return dot(cross(axisOf(crank), axisOf(elbow)), second) / Math.max(norm(second), POINT);
    const lengths = norm(first) * norm(second);
    return lengths > 0 ? dot(cross(first, second), axisOf(crank)) / lengths : 0;
  });
}

const sign = (value) => (Math.abs(value) <= STRAIGHT ? "0" : value > 0 ? "+" : "-");

// Determinant of the passive columns of the closure, positive at home; null where it has no sign.
export function assemblyValue(data, q) {
  if (!data.assembly) return null;
  const { rows, sign: home } = data.assembly, { G } = closure(data, q), passive = passiveOf(data);
  return home * determinant(rows.map((r) => passive.map((j) => G[r][j])));
}

// "+" as at home, "-", "0" at a type 2 singularity, "?" where there is no sign.
export function assemblySign(data, q) {
  const value = assemblyValue(data, q);
  return value === null ? "?" : sign(value);
}

// Assembly and working mode in words: "assembly +, elbows -+"; "." stands for an input without an elbow.
export function modeOf(data, q) {
  const assembly = `assembly ${assemblySign(data, q)}`, found = elbowSines(data, q).map(sign);
  const cranks = data.elbows.map((e) => e.crank);
  const signs = found.length ? data.actuated.map((j) => found[cranks.indexOf(j)] ?? ".").join("") : "";
  return signs ? `${assembly}, elbows ${signs}` : assembly;
}

const ORDER = { "+": 0, 0: 0, "-": 1, "?": 2 };

// What modes are listed by: the home assembly first, elbows to the left first.
export const modeOrder = (data, q) => [assemblySign(data, q), ...elbowSines(data, q).map(sign)].map((s) => ORDER[s]);

// Balls that a file writes as three hinges: where these lie in a plane, a gimbal lock, the ball itself
// still turns in every direction. Beside a lock the columns of its hinges are replaced by those of turns
// about the axes of the base through its centre, which span the same turns wherever the hinges are
// independent. As in `whole_balls.py`.

const BESIDE = 0.1; // volume of the three axes up to which a lock is near
const FLAT = 1e-6;

const axesOf = (data, places, ball) => ball.joints.map((j) => times(places[j].R, data.chain.joints[j].axis));

// Whether a ball is locked, or nearly.
export const locked = (data, places) => (data.balls ?? []).some((ball) => {
  const [a, b, c] = axesOf(data, places, ball);
  return Math.abs(dot(cross(a, b), c)) <= BESIDE;
});

// `jacobian` with whole balls: (chain, places, frame) to 6 x n.
export const ballColumns = (data) => (chain, places, frame) => {
  const J = jacobian(chain, places, frame), at = frameOf(frame, places).t;
  for (const { joints, centre } of data.balls) {
    if (norm(J.slice(3).map((row) => row[joints[2]])) === 0) continue; // the frame is not beyond it
    const arm = subtract(at, frameOf({ parent: joints[0], R: identity(3), t: centre }, places).t);
    identity(3).forEach((e, k) => [...cross(e, arm), ...e].forEach((v, i) => { J[i][joints[k]] = v; }));
  }
  return J;
};

// Joint velocities of motions (d vectors) in which balls are whole: three hinges in a plane show of a
// turn what they can, its part in that plane.
export const hingeRates = (data, places, basis) => basis.map((motion) => {
  const out = motion.slice();
  for (const ball of data.balls) {
    const turn = ball.joints.map((j) => motion[j]), axes = transpose(axesOf(data, places, ball));
    leastNorm(axes, turn, FLAT).forEach((v, k) => { out[ball.joints[k]] = v; });
  }
  return out;
});
