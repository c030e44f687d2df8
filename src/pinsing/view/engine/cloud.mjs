// Where the tip gets to, and how clear of all families it is there.

import { placements, tipOf } from "./chain.mjs";
import { clearanceOf } from "./clearance.mjs";
import { generator } from "./families.mjs";

// Poses drawn at random within the limits, the same ones each time: { at: tip, clearance } of each, in
// batches, so that a page can breathe between them. Of joints without limits a turn, or the length scale.
export function* cloud(data, count = 6000, batch = 200) {
  const random = generator(17), L = data.task.lengthScale;
  const limits = data.joints.map((joint) => {
    const reach = joint.prismatic ? L : Math.PI;
    return [joint.lower ?? -reach, joint.upper ?? reach];
  });
  for (let done = 0; done < count; done += batch) {
    yield Array.from({ length: Math.min(batch, count - done) }, () => {
      const q = limits.map(([low, high]) => low + random() * (high - low));
      return { at: tipOf(data.chain, placements(data.chain, q)).t, clearance: clearanceOf(data, q) };
    });
  }
}
