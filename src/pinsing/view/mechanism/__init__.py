"""A mechanism in a browser tab: inputs to drag, passive joints that follow, modes to choose."""

from pinsing.view.mechanism.viewer import MechanismViewer

__all__ = ["MechanismViewer"]
