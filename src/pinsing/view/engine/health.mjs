// The pose of a mechanism that is clearest of singular ones, as far as a search finds it.

import { generator } from "./families.mjs";
import { outside, spanOf, turnedInto } from "./limits.mjs";
import { CLOSED, closure, everyJoint, gaussNewton, worst } from "./loops.mjs";
import { motions } from "./mechanism.mjs";

const CLIMBED = 3, FIRST = 0.4, LAST = 0.01, AROUND = [0.05, 0.2, 0.5];

// How well a pose is away from all singularities: its smallest measure; 0 where it is outside limits.
export function healthOf(data, q) {
  if (worst(closure(data, q).residual) > CLOSED) return 0;
  const { one, two, constraint } = motions(data, q);
  return outside(data, q).length ? 0 : Math.min(one, two, constraint);
}

// The pose { q, measure } whose smallest measure is largest, of `tries` at random and those given: home,
// poses around it, and poses anywhere within the limits; the best of them are climbed from. q is null
// where none within the limits is regular.
export function healthiestPose(data, given = [], tries = 160, steps = 60) {
  const random = generator(23), spans = data.joints.map((joint, j) => spanOf(joint, data.metric[j]));
  const drawn = () => spans.map(([low, high]) => low + (high - low) * random());
  const around = (q, size) => q.map((v, j) => v + size * data.metric[j] * (2 * random() - 1));
  const found = [];
  const tried = (start) => {
    const { q: closed, error } = gaussNewton(data, start, everyJoint(data));
    const q = closed.map((v, j) => turnedInto(spans[j], v, data.joints[j].prismatic)), measure = error <= CLOSED ? healthOf(data, q) : 0;
    if (measure > 0) found.push({ q, measure });
    return measure;
  };
  [data.home, ...given].forEach(tried);
  for (let k = 0; k < tries; k++) tried(k % 2 ? around(data.home, AROUND[k % AROUND.length]) : drawn());
  const best = found.sort((a, b) => b.measure - a.measure).slice(0, CLIMBED);
  for (const start of best) {
    let top = start;
    for (let size = FIRST, k = 0; k < steps && size > LAST; k++) {
      const count = found.length;
      tried(around(top.q, size / Math.sqrt(top.q.length)));
      const now = found.length > count ? found[found.length - 1] : null;
      if (now && now.measure > top.measure) { top = now; size = Math.min(FIRST, 1.5 * size); } else size *= 0.85;
    }
  }
  return found.reduce((a, b) => (b.measure > a.measure ? b : a), { q: null, measure: 0 });
}
