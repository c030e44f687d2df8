"""See it: an arm, its singular poses and its velocity ellipsoids, in a browser tab."""

from pinsing.view.viewer import Viewer

__all__ = ["Viewer"]
