"""A page that shows the singular poses of a robot and computes by itself; it needs no server.

python examples/02_view.py page.html
"""

import sys

import pinsing

arm = pinsing.load("puma560")
families = pinsing.closed_form(arm).families
pose = [0, 0.7, -0.9, 0.3, 0.0, 0.2]
with pinsing.Viewer(arm, families, poses=[pose], skeleton=True) as viewer:
    print("shows", ", ".join(entry.name for entry in viewer.entries))
    viewer.save_html(sys.argv[1] if len(sys.argv) > 1 else "puma560.html")
