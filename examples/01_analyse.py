"""All singular configurations of a robot: families, and how sure it is that none is missing.

python examples/01_analyse.py [ROBOT]
"""

import sys

import numpy as np

import pinsing

arm = pinsing.load(sys.argv[1] if len(sys.argv) > 1 else "ur5")
found = pinsing.analyze(arm)
form = found.closed_form
print(f"{arm.name}: {len(form.families)} families, complete: {form.complete}")
rng = np.random.default_rng(0)
for family in form.families:
    print(f"{family.name} ({family.kind}, codimension {family.codimension}): {family.text}")
    sigma = pinsing.singular_values(arm, family.sample(5, rng))
    print(f"  sigma_r/sigma_1 at points of it: {(sigma[:, -1] / sigma[:, 0]).max():.0e}")
