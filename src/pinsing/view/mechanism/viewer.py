"""MechanismViewer: a mechanism with closed loops, live in a browser tab."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pinsing.errors import OptionError
from pinsing.loops.analysis import analyze_mechanism
from pinsing.loops.motion import mechanism_at
from pinsing.loops.problems import assemblies
from pinsing.loops.result import MechanismAnalysis
from pinsing.loops.solve import drive
from pinsing.robot.mechanism import Mechanism
from pinsing.view.links import Links, Recorder, read_links
from pinsing.view.mechanism.linkage import Linkage, draw_linkage_marks, linkage_sizes
from pinsing.view.mechanism.stage import Group, MechanismStage, groups
from pinsing.view.scene import draw_scene
from pinsing.view.tab import Tab, place_in_list


class MechanismViewer(Tab):
    """Shows a mechanism: sliders for the actuated joints, modes, and its singular poses.

    `show` and `show_group` lead every open tab. A server is started when its address is first
    asked for (`url`, `open`, or a notebook that displays the viewer), inside this process and
    on loopback only.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    analysis : MechanismAnalysis, optional
        What to list; by default that of ``analyze_mechanism(mechanism)``.
    scale : float
        Size of the velocity ellipses; 1 is about a quarter of the mechanism.
    skeleton : bool
        Leave out the shapes of the links.
    host, port : str, int
        Where to listen; by default loopback, the first free port from 7000 on.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        analysis: MechanismAnalysis | None = None,
        *,
        scale: float = 1.0,
        skeleton: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        if not (np.isfinite(scale) and scale > 0):
            raise OptionError(f"scale must be a positive number, got {scale!r}")
        self.mechanism = mechanism
        if analysis is None:
            analysis = analyze_mechanism(mechanism)
            if analysis.missing:  # Ctrl-C
                raise KeyboardInterrupt
        listed = groups(mechanism, analysis)
        size = linkage_sizes(mechanism, scale)
        linkage = Linkage(mechanism)
        links = Links(None) if skeleton else read_links(linkage)
        recorder = Recorder()
        root = recorder.visualizer()
        notes = draw_scene(root, linkage, links, size, linkage.ends)
        draw_linkage_marks(root["pinsing"], mechanism, size)
        self._stage = MechanismStage(mechanism, listed, links, size, skeleton, notes)
        super().__init__(self._stage, *recorder.parts(), host, port)

    @property
    def groups(self) -> tuple[Group, ...]:
        """What the page lists."""
        return self._stage.groups

    def show(self, q: npt.ArrayLike) -> None:
        """Move the mechanism, in every open tab, to the closed configuration q (n,).

        Raises
        ------
        ConfigurationError
            If q has the wrong length, or the loops do not close there.
        """
        q = mechanism_at(self.mechanism, q).q  # refuses open loops
        self._move(q, None)

    def show_inputs(self, inputs: npt.ArrayLike) -> None:
        """Drive the mechanism to inputs (n_a,) in its mode, or put it together there in another.

        Raises
        ------
        InfeasibleError
            If the loops close there in no mode.
        """
        inputs = self.mechanism.check_inputs(inputs)
        found = drive(self.mechanism, inputs, self.q)
        q = found.q if found.converged else assemblies(self.mechanism, inputs)[0].q
        self._move(q, None)

    def show_group(self, group: str | int, pose: int = 0) -> None:
        """Move the mechanism to a pose of the list.

        Parameters
        ----------
        group : str or int
            Name, such as ``L1``, or place in the list.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such group.
        OptionError
            If it has no such pose.
        """
        index = self._index(group, pose)
        self._move(self._stage.pose_q(index, pose), (index, pose))

    def play(self, group: str | int, kind: str = "into", pose: int = 0) -> None:
        """Play a motion in every open tab: ``into`` the singular pose, or ``along`` its locus."""
        self._play(self._index(group, pose), pose, kind)

    def _index(self, group: str | int, pose: int) -> int:
        return place_in_list([(g.name, len(g.points)) for g in self.groups], group, pose)
