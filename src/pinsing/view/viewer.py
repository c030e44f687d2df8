"""Viewer: singular poses, ellipsoids and lost motions of an arm, in a browser tab."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from pinsing.arguments import checked, shown
from pinsing.errors import ArgumentError, OptionError
from pinsing.families import Family, joint_symbols
from pinsing.families.form import coverage_words
from pinsing.families.tube import Tube
from pinsing.kinematics.jacobian import frame_jacobians
from pinsing.measures import SINGULAR_RTOL, Array, ArrayLike, pure_ellipsoids
from pinsing.proximity.zones import Zones, zone_distances
from pinsing.robot.arm import Arm, summarize
from pinsing.sampling.generalize import Finding
from pinsing.view.entries import (
    Entry,
    engine_data,
    family_entries,
    finding_entries,
    listed_postures,
    pose_entries,
)
from pinsing.view.links import read_links_ahead
from pinsing.view.scene import Overlay, sizes
from pinsing.view.tab import Tab

if TYPE_CHECKING:
    from pinsing.postures.changes import PostureChanges
    from pinsing.proximity.suggestion import Suggestion


def _solved(entry: Entry) -> list[dict[str, Any]]:
    """Long equations, each as one for a joint: texts."""
    if entry.family is None:
        return []
    lines = [line for one in entry.family.at_once for line in one.lines()]
    together = [{"condition": x, "solution": "", "where": [], "exact": []} for x in lines]
    names = ("condition", "solution", "where", "exact")
    return together + [{k: getattr(one, k) for k in names} for one in entry.family.solved]


def _entry(entry: Entry, n: int) -> dict[str, Any]:
    moves = bool(entry.poses) and not entry.name.startswith("P")
    told = (
        (entry.kind, entry.kind),
        (entry.codimension, f"codimension {entry.codimension}"),
        (entry.reach, entry.reach),
        (entry.reachable is False, "out of reach of the limits"),
        (entry.reachable is None, "no configuration found within the limits"),
    )
    return {
        "name": entry.name,
        "text": entry.text,
        "given": entry.name.startswith("P"),
        "more": [words for there, words in told if there],
        "reason": entry.reason,
        "solved": _solved(entry),
        "poses": len(entry.poses),
        "q": [pose.tolist() for pose in entry.poses],
        "moved": list(entry.moved),
        "into": moves,
        "along": moves
        and entry.family is not None
        and (entry.codimension is None or entry.codimension < n),
    }


class Viewer(Tab):
    """Shows an arm at singular configurations.

    The page lists the families, plays motions, and has sliders; `show` and `show_family`
    lead every open tab. A server is started when its address is first asked for (`url`,
    `open`, or a notebook that displays the viewer), inside this process and on loopback only.

    Parameters
    ----------
    arm : Arm
        The arm.
    families : iterable of Family, optional
        What to list; by default all families of ``closed_form(arm)``, unless ``poses`` or
        ``findings`` are given.
    poses : iterable of (n,) array_like, optional
        Configurations to list, radians and metres.
    findings : iterable of Finding, optional
        What a sweep has found, to be listed as well.
    path : (N, n) array_like, optional
        A joint motion, radians and metres, linear between its samples: pages open with what
        `check_trajectory` says of it, show it as a line of the tip coloured by clearance, and
        play it.
    times : (N,) array_like, optional
        Its times, seconds.
    shown : mapping, optional
        The same as `trajectory_data` gave it, where it was checked before.
    postures : PostureChanges, optional
        Inverse solutions of one pose, by `posture_changes`: pages list them, and play the way to
        each that can be reached without a singularity.
    coverage : str
        How sure it is that the families are all, which pages say above the list; by default what
        ``closed_form(arm)`` says where the families are its own.
    clearest : Suggestion, optional
        A clear configuration, by `suggest`: the page's button leads to none that is worse.
    zones : Zones or Tube, optional
        Those of the arm and of joint ranges, from `pinsing.zones`, or where the singular
        configurations of a robot are beside its design's (`form.tube`): red at the sliders.
    visualizer : pinocchio MeshcatVisualizer or meshcat.Visualizer, optional
        Draw into this one as well: axes, ellipsoids and lost motions below its node
        ``pinsing``. One that displays the robot of the arm is moved along.
    scale : float
        Size of the ellipsoids; 1 is about a quarter of the reach.
    skeleton : bool
        Leave out meshes: small pages.
    host, port : str, int
        Where to listen; by default loopback, the first free port from 7000 on.

    Attributes
    ----------
    arm : Arm
        The arm.
    entries : tuple of Entry
        What the page lists.

    Examples
    --------
    >>> import pinsing
    >>> with pinsing.Viewer(pinsing.load("planar3r"), skeleton=True) as viewer:
    ...     print([entry.name for entry in viewer.entries])
    ['F1']
    """

    @checked
    def __init__(
        self,
        arm: Arm,
        families: Iterable[Family] | None = None,
        poses: Iterable[ArrayLike] | None = None,
        findings: Iterable[Finding] | None = None,
        *,
        path: ArrayLike | None = None,
        times: ArrayLike | None = None,
        shown: Mapping[str, Any] | None = None,
        postures: PostureChanges | None = None,
        coverage: str = "",
        clearest: Suggestion | None = None,
        zones: Zones | Tube | None = None,
        visualizer: Any = None,
        scale: float = 1.0,
        skeleton: bool = False,
        host: str = "127.0.0.1",
        port: int | None = None,
    ) -> None:
        OptionError.refuse_if(
            not 0 < scale < 1e6, f"scale must be a positive number, got {scale!r}"
        )
        self.arm = arm
        if not skeleton:
            read_links_ahead(arm)
        if families is None and poses is None and findings is None:
            from pinsing.families import closed_form

            form = closed_form(arm)
            families, coverage = form.families, coverage or coverage_words(form)
        self.entries = (
            *pose_entries(arm, () if poses is None else poses),
            *family_entries(arm, () if families is None else families),
            *finding_entries(arm, () if findings is None else findings),
        )
        if clearest is not None:
            _check_clearest(arm, clearest)
        self._postures = () if postures is None else _listed(arm, postures)
        super().__init__(arm, sizes(arm, scale), skeleton, [arm.tip_id], host, port)
        if path is not None:
            from pinsing.proximity.trajectory import check_trajectory
            from pinsing.view.trajectory import trajectory_data

            Q = np.atleast_2d(arm.check(path))
            t = None if times is None else np.asarray(times, dtype=float)
            shown = trajectory_data(arm, check_trajectory(arm, Q, t), Q, t)
        self._way, self._coverage, self._clearest = shown, coverage, clearest
        # Bands at the sliders: joint ranges, distances, and why.
        self._zones = None if zones is None else _bands(zones, arm, [e.name for e in self.entries])
        listed = ((i, 0) for i, entry in enumerate(self.entries) if entry.poses)
        self._chosen = None if postures is not None else next(listed, None)
        if postures is not None:
            self._q = postures.q
        elif self._chosen is not None:
            self._q = self.entries[self._chosen[0]].poses[0]
        else:
            self._q = np.mean(arm.span, axis=0)
        self._overlay = None
        if visualizer is not None:
            self._overlay = Overlay(visualizer, arm, self._sizes)
            self._overlay.show(self._q, self._mode)

    @checked
    def show(self, q: ArrayLike, words: str = "") -> None:
        """Move the arm, in every open tab.

        Parameters
        ----------
        q : (n,) or (nq,) array_like
            Radians and metres.
        words : str
            A line for the page to say; the camera then stays as it is.

        Raises
        ------
        ConfigurationError
            If q has the wrong length or is not finite.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.show([0, 0.5, 1])
        >>> viewer.q
        array([0. , 0.5, 1. ])
        """
        self._move(self.arm.check_one(q), None, words)

    @checked
    def show_family(self, family: Family | str | int, pose: int = 0) -> None:
        """Move the arm to a pose of a family.

        Parameters
        ----------
        family : Family, str or int
            The family, its name, or its place in the list.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such family.
        OptionError
            If it has no such pose within the limits.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.show_family("F1")
        >>> pinsing.at(viewer.arm, viewer.q).status
        'singular'
        """
        self._go(self._wanted(family), pose)

    @checked
    def play(self, family: Family | str | int, kind: str = "into", pose: int = 0) -> None:
        """Play a motion in every open tab.

        Parameters
        ----------
        family : Family, str or int
            The family, its name, or its place in the list.
        kind : str
            ``into`` the singular pose, or ``along`` the family.
        pose : int
            Which of its poses, counted from 0.

        Raises
        ------
        UnknownNameError
            If the list has no such family.
        OptionError
            If there is no such pose, or no such kind of motion.

        Examples
        --------
        >>> import pinsing
        >>> viewer = pinsing.Viewer(pinsing.load("planar3r"), skeleton=True)
        >>> viewer.play("F2")
        Traceback (most recent call last):
        pinsing.errors.UnknownNameError: unknown family 'F2': did you mean 'F1'?
        """
        self._play(self._wanted(family), kind, pose)

    def _poses(self) -> list[tuple[str, Sequence[Array]]]:
        return [(e.name, e.poses) for e in self.entries]

    def _dropped(self, name: str, content: bytes, degrees: bool | None) -> dict[str, Any]:
        """What a page shows of a file that was dropped onto it."""
        from pinsing.view.trajectory import dropped

        return dropped(self.arm, name, content, degrees)

    def _page(self, live: bool) -> dict[str, Any]:
        arm = self.arm
        return {
            "live": live,
            "way": self._way,
            "postures": list(self._postures),
            "robot": {
                "name": arm.name,
                "base": arm.base,
                "tip": arm.tip,
                "task": str(arm.task),
                "lengthScale": arm.length_scale,
            },
            "joints": self._joints(joint_symbols(arm)),
            "settings": self._settings(self._mode),
            "entries": [_entry(e, arm.n) for e in self.entries],
            "engine": engine_data(arm, self.entries, self._sizes),
            "notes": [
                *arm.notes,
                *self.notes,
                *[f"described by {summarize(arm).described}"] * bool(arm.source.calibration),
            ],
            "coverage": self._coverage,
            "zones": self._zones,
            "clearest": None
            if self._clearest is None
            else {"q": self._clearest.q.tolist(), "lower": float(self._clearest.lower)},
        }

    @cached_property
    def _mode(self) -> str:
        """Return pure motions of a pose task where regular ones fill a plane or more."""
        # They go flat, or to a line, where a motion is lost; those of an arm of three or four
        # joints are lines or points everywhere.
        arm, rng = self.arm, np.random.default_rng(0)
        if arm.task.name != "pose":
            return "all"
        for J in frame_jacobians(arm, rng.uniform(*arm.span, (4, arm.n))):
            if all(e.radii[1] > SINGULAR_RTOL * max(e.radii[0], 1e-9) for e in pure_ellipsoids(J)):
                return "pure"
        return "all"

    def _wanted(self, family: Family | str | int) -> str | int:
        """Name or place of an entry, also where a family is called by its title."""
        if not isinstance(family, (int, str)):
            return family.name
        alike = [e.name for e in self.entries if e.family and e.family.title == family]
        return alike[0] if family and alike else family

    def _move(self, q: Array, chosen: tuple[int, int] | None, words: str = "") -> None:
        super()._move(q, chosen, words)
        if self._overlay is not None:
            self._overlay.show(q, self._mode)


def _check_clearest(arm: Arm, clearest: Suggestion) -> None:
    from pinsing.proximity.suggestion import Suggestion

    if not isinstance(clearest, Suggestion):
        raise ArgumentError(
            "clearest", "a Suggestion", shown(clearest), "pinsing.suggest(arm) gives one"
        )
    OptionError.refuse_if(clearest.arm.joints != arm.joints, "clearest is of another arm")


def _listed(arm: Arm, postures: PostureChanges) -> tuple[dict[str, Any], ...]:
    # Few pages have any, and a browser would wait for an import as long as that of the families.
    from pinsing.postures.changes import PostureChanges

    if not isinstance(postures, PostureChanges):
        hint = "pinsing.posture_changes(arm, q) gives one"
        raise ArgumentError("postures", "a PostureChanges", shown(postures), hint)
    return listed_postures(arm, postures)


def _bands(of: Zones | Tube, arm: Arm, names: Sequence[str]) -> dict[str, Any] | None:
    """What is red at the sliders of an arm whose page lists entries of these names."""
    if isinstance(of, Tube):
        if not of.proven:
            return None
        return {
            "middle": [0.0] * arm.n,
            "half": [1e9] * arm.n,
            "far": {f.family: of.alone for f in of.families if f.family in names},
            "meeting": {"more": of.width - of.alone, "near": of.near - of.alone},
            "why": f"near the design's families; singular configurations of {of.whose} lie "
            f"{of.where}",
        }
    zone_distances(of, summarize(arm), arm, names)
    return {
        "middle": ((of.lower + of.upper) / 2).tolist(),
        "half": ((of.upper - of.lower) / 2).tolist(),
        "far": of.distances,
        "why": f"too near for {of.speeds}, or not proven to be far enough",
    }
