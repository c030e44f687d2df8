// Inputs that are given: within their limits, and one after the other as a file has them.

import { driven } from "./pose_drive.mjs";
import { inputText } from "./surroundings.mjs";

const INSIDE = 1e-9;

// Inputs cut at the limits of their joints, and the places of those that were beyond.
export function withinInputs(data, inputs) {
  const wanted = inputs.map((v, k) => {
    const { lower, upper } = data.joints[data.actuated[k]];
    return Math.min(upper ?? Infinity, Math.max(lower ?? -Infinity, v));
  });
  return { wanted, beyond: inputs.flatMap((v, k) => (Math.abs(v - wanted[k]) > INSIDE * data.metric[data.actuated[k]] ? [k] : [])) };
}

// The same in words.
export function beyondWords(data, inputs, beyond) {
  const { wanted } = withinInputs(data, inputs);
  return beyond.map((k) => `${data.joints[data.actuated[k]].name} = ${inputText(data, k, inputs[k])} is beyond its limit, ${inputText(data, k, wanted[k])}`).join("; ");
}

// Rows of inputs followed from a closed q, as far as it goes: { path: configurations, row, stop }: of the row
// that ended it, its place and what `driven` says, or the inputs that are beyond their limits.
export function followInputs(data, q, rows) {
  const path = [];
  for (const [row, inputs] of rows.entries()) {
    const { wanted, beyond } = withinInputs(data, inputs);
    if (beyond.length) return { path, row, beyond };
    const found = driven(data, wanted, path.length ? path[path.length - 1] : q);
    if (found.reached < 1) return { path, row, found };
    path.push(found.q);
  }
  return { path, row: -1 };
}
