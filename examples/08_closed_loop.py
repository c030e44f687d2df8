"""A five-bar linkage: its modes, and where it loses a direction or cannot hold a force."""

from pathlib import Path

import pinsing

urdf = Path(__file__).parent.parent / "urdf"
linkage = pinsing.load_mechanism(urdf / "five_bar.urdf", urdf / "five_bar.loops.yaml")
inputs = [1.0472, 1.0472]
print(len(pinsing.loops.assembly_modes(linkage, inputs).modes), "assembly modes")

found = pinsing.loops.analyze_mechanism(linkage)
print(found)
