// Values and limits of joints; `lower` and `upper` are null where there is none, and `span` is where they
// are drawn: within the limits, else a turn, or a length to both sides.

const TURN = 2 * Math.PI, SLACK = 1e-9;

// A value of a joint, degrees or millimetres.
export const valueText = (prismatic, value, digits = 1) =>
  (prismatic ? `${(1000 * value).toFixed(digits)} mm` : `${((value * 180) / Math.PI + 0).toFixed(digits)}\u00b0`);

// A value moved by whole turns into where it may be, if it is not there and that has two ends.
export function turnedInto([low, high], value, prismatic) {
  if (prismatic || (value >= low && value <= high) || !Number.isFinite(high - low)) return value;
  return value - TURN * Math.round((value - (low + high) / 2) / TURN);
}

export const endsOf = ({ lower, upper }) => [lower ?? -Infinity, upper ?? Infinity];

export function isOutside(joint, value) {
  const [low, high] = endsOf(joint);
  return value < low - SLACK || value > high + SLACK;
}

// Names of the joints outside their limits, as their values are: no whole turn is taken off.
export const outside = (data, q) => data.joints.filter((joint, i) => isOutside(joint, q[i])).map((joint) => joint.name);

// Whether a value of a limited revolute joint makes sense in degrees only: more than a turn beyond a limit,
// and within both if read as degrees.
export function inDegrees({ prismatic, lower, upper }, value) {
  if (prismatic || !Number.isFinite(lower) || !Number.isFinite(upper)) return false;
  const read = (value * Math.PI) / 180;
  return (value < lower - TURN || value > upper + TURN) && read > lower - 0.01 && read < upper + 0.01;
}
