"""See a mechanism: one page with the linkage moving along a curve, and its velocity ellipse.

The page is meshcat's own viewer with a recorded scene and animation; it needs no server.
"""

from __future__ import annotations

import base64
import html
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from meshcat.animation import Animation, AnimationFrameVisualizer

from pinsing._types import Array
from pinsing.atomic_write import write_text
from pinsing.errors import OptionError
from pinsing.mechanism.motion import mechanism_at
from pinsing.robot.load_mechanism import Mechanism
from pinsing.view.meshes import read_geometry
from pinsing.view.page import meshcat_script
from pinsing.view.record import Recorder

_ELLIPSE = "pinsing/ellipse"
_FREE = "pinsing/uncontrolled"
_FLOOR = 1e-3
_LONGEST = 4.0
_COLORS = {"regular": 0x2E8B57, "type 1": 0xC0392B, "type 2": 0x1F5FA8}

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; \
script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; \
connect-src data: blob:; worker-src blob:">
<style>html,body{{margin:0;height:100%;font:14px system-ui,sans-serif}}
#meshcat-pane{{width:100vw;height:100vh;overflow:hidden}}
#words{{position:fixed;left:1em;bottom:1em;max-width:34em;background:#ffffffd9;padding:.6em .9em;
border-radius:6px;white-space:pre-line}}</style></head>
<body><div id="meshcat-pane"></div><div id="words">{words}</div>
<script>{meshcat}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
const bytes = Uint8Array.from(atob("{data}"), c => c.charCodeAt(0));
const view = new DataView(bytes.buffer);
for (let at = 0; at < bytes.length;) {{
  const size = view.getUint32(at, true);
  viewer.handle_command_bytearray(bytes.subarray(at + 4, at + 4 + size));
  at += 4 + size;
}}
document.body.dataset.ready = "yes";
</script></body></html>
"""


def mechanism_page(
    mechanism: Mechanism,
    path: npt.ArrayLike,
    words: str = "",
    scale: float = 0.25,
    frames_per_second: float = 20.0,
) -> str:
    """Page that shows a mechanism moving along closed configurations.

    The velocity ellipse of the output lies at the output frame: green, red at type 1, where it
    is a line. At type 2 it gives way to a blue bar along the velocity that the actuators cannot
    hold.

    Parameters
    ----------
    path : (N, n) array_like
        Closed configurations in order, radians and metres; one is a still picture.
    words : str
        What to say on the page.
    scale : float
        Metres that 1 m per unit input speed is drawn as.
    frames_per_second : float
        Configurations shown in a second.

    Raises
    ------
    OptionError
        If there is no configuration to show.
    """
    Q = np.atleast_2d(mechanism.check(path))
    if not len(Q):
        raise OptionError("give at least one configuration to show")
    recorder = Recorder()
    visualizer = recorder.visualizer()
    scene = _Scene(mechanism, visualizer, scale)
    scene.show(visualizer, Q[0])
    if len(Q) > 1:
        animation = Animation(default_framerate=frames_per_second)
        for i, q in enumerate(Q):
            with animation.at_frame(visualizer, i) as frame:
                scene.show(frame, q)
        visualizer.set_animation(animation, play=True, repetitions=10_000)
    return _PAGE.format(
        title=html.escape(mechanism.name),
        words=html.escape(words or str(mechanism)),
        meshcat=meshcat_script().replace("</script", "<\\/script"),
        data=base64.b64encode(recorder.packed()).decode(),
    )


def save_mechanism_page(
    mechanism: Mechanism, path: npt.ArrayLike, file: str | os.PathLike[str], words: str = ""
) -> Path:
    """Write ``mechanism_page`` to a file."""
    write_text(Path(file), mechanism_page(mechanism, path, words))
    return Path(file)


class _Scene:
    """Links as drawn in the URDF, and what is drawn at the output."""

    def __init__(self, mechanism: Mechanism, visualizer: Any, scale: float) -> None:
        import meshcat.geometry as mg

        self.mechanism, self.scale = mechanism, scale
        model = mechanism.model
        self.data = model.createData()
        self.output = mechanism.output_id
        self._axes: Array = np.eye(3)
        rows = list(mechanism.task.rows)
        # Position of vx, vy, vz among the rows of the task.
        self.plane = [(rows.index(k), k) for k in (0, 1, 2) if k in rows]
        self.visuals = self._visuals()
        for name, visual in self.visuals:
            color = [round(255 * float(c)) for c in np.array(visual.meshColor)[:3]]
            material = mg.MeshPhongMaterial(color=color[0] << 16 | color[1] << 8 | color[2])
            visualizer[name].set_object(_shape(visual.geometry, mg), material)
        visualizer[_ELLIPSE].set_object(
            mg.Sphere(1.0), mg.MeshPhongMaterial(color=_COLORS["regular"], opacity=0.45)
        )
        visualizer[_FREE].set_object(
            mg.Box([0.95, 0.96, 0.97]), mg.MeshPhongMaterial(color=_COLORS["type 2"])
        )
        reach = self._reach()
        visualizer["/Cameras/default/rotated/<object>"].set_property(
            "position", [0.0, 1.15 * reach, 0.3 * reach]
        )
        for end in ("top_color", "bottom_color"):
            visualizer["/Background"].set_property(end, [0.95, 0.96, 0.97])
        visualizer["/Axes"].set_property("visible", False)
        visualizer["/Grid"].set_property("visible", False)

    def _like_before(self, axes: Array) -> Array:
        """Right-handed axes, each in the sense of the frame before: no turns between frames."""
        axes = axes * np.where((axes * self._axes).sum(axis=0) < 0, -1.0, 1.0)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        self._axes = axes
        return axes

    def _visuals(self) -> list[tuple[str, Any]]:
        source, model = self.mechanism.source, self.mechanism.model
        if source.xml is None:
            raise OptionError(f"{self.mechanism.name} has no URDF: there are no links to draw")
        geometry, _ = read_geometry(model, source.xml)
        return [(f"links/{g.name}", g) for g in geometry.geometryObjects]

    def _reach(self) -> float:
        places = [np.linalg.norm(p.translation) for p in self.mechanism.model.jointPlacements]
        return max(2 * float(sum(places)) / 3, 0.1)

    def show(self, target: Any, q: Array) -> None:
        """Place everything; ``target`` is a visualizer or a frame of an animation."""
        model = self.mechanism.model
        pin.framesForwardKinematics(model, self.data, self.mechanism.model_q(q))
        for name, visual in self.visuals:
            placement = self.data.oMi[visual.parentJoint] * visual.placement
            target[name].set_transform(placement.homogeneous @ _turned(visual.geometry))
        here = np.array(self.data.oMf[self.output].translation)
        state = mechanism_at(self.mechanism, q)
        radii, axes = np.full(3, _FLOOR), np.eye(3)
        bar, along = np.full(3, _FLOOR), np.eye(3)
        if self.plane and state.velocity is not None:
            rows = np.zeros((3, state.velocity.shape[1]))
            rows[[k for _, k in self.plane]] = state.velocity[[i for i, _ in self.plane]]
            axes, sigma, _ = np.linalg.svd(rows)
            axes = self._like_before(axes)
            size = np.zeros(3)
            size[: len(sigma)] = np.minimum(sigma, _LONGEST) * self.scale
            # A semi-axis of exactly zero makes the ellipsoid vanish.
            radii = np.maximum(size, 4 * _FLOOR * self.scale)
        elif self.plane and state.uncontrolled.shape[1]:
            direction = np.zeros(3)
            free = state.uncontrolled[[i for i, _ in self.plane], 0]
            direction[[k for _, k in self.plane]] = free
            if np.linalg.norm(direction) > _FLOOR:
                along = _frame_along(direction)
                bar = np.array([2.5, 0.06, 0.06]) * self.scale
        _place(target[_ELLIPSE], here, axes, radii)
        _place(target[_FREE], here, along, bar)


def _place(node: Any, point: Array, axes: Array, size: Array) -> None:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = axes, point
    node.set_transform(T)
    # An animation's transforms have no scale: it is a property of its own there.
    scale = [float(x) for x in size]
    if isinstance(node, AnimationFrameVisualizer):
        node.set_property("scale", "vector", scale)
    else:
        node.set_property("scale", scale)


def _frame_along(direction: Array) -> Array:
    x = direction / np.linalg.norm(direction)
    other = np.eye(3)[int(np.argmin(np.abs(x)))]
    y = np.cross(x, other)
    y /= np.linalg.norm(y)
    return np.stack([x, y, np.cross(x, y)], axis=1)


def _shape(geometry: Any, mg: Any) -> Any:
    """Shape of the URDF as one of meshcat's."""
    kind = type(geometry).__name__
    if kind == "Cylinder":
        return mg.Cylinder(2 * geometry.halfLength, geometry.radius)
    if kind == "Sphere":
        return mg.Sphere(geometry.radius)
    if kind == "Box":
        return mg.Box(2 * np.array(geometry.halfSide))
    raise OptionError(f"a link has a {kind}: only cylinders, boxes and spheres are drawn")


def _turned(geometry: Any) -> Array:
    """Meshcat's cylinders lie along y, those of a URDF along z."""
    T = np.eye(4)
    if type(geometry).__name__ == "Cylinder":
        T[:3, :3] = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    return T
