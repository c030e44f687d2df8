"""See it: an arm, its singular poses and its velocity ellipsoids, in a browser tab.

`Viewer` is imported when it is first asked for: a server can start, and a browser with it, before
the algebra and what draws are there.
"""

from typing import TYPE_CHECKING

from pinsing._package import public

if TYPE_CHECKING:
    from pinsing.view.viewer import Viewer as Viewer

public(__name__, {"viewer": "Viewer"}, called="pinsing.Viewer(arm)")
