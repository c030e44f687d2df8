"""The report of a mechanism with closed loops, as one HTML text."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping

import numpy as np

from pinsing._types import Array
from pinsing._version import __version__
from pinsing.loops import MechanismAnalysis, analyze_mechanism, mechanism_at
from pinsing.loops.problems import assemblies
from pinsing.loops.solve import InfeasibleError
from pinsing.report.arm_report import SCHEMA
from pinsing.report.content import Made
from pinsing.report.document import computed, data, document, model, result
from pinsing.report.mechanism_sections import (
    SpecialInputs,
    aspects,
    assumed,
    loci,
    maps,
    modes,
    points,
    robot,
    summary,
    sure,
    verdicts,
    words,
)
from pinsing.report.pictures import quiet_backend
from pinsing.robot.joint_space import SLACK
from pinsing.robot.mechanism import Mechanism


def mechanism_report(
    mechanism: Mechanism,
    poses: Mapping[str, Array],
    page: bool,
    beside: str | None,
    skeleton: bool,
) -> tuple[str, str | None]:
    """The report of a mechanism, and the interactive page that belongs beside it.

    Parameters
    ----------
    mechanism : Mechanism
        The mechanism.
    poses : mapping of str to (n_a,) array
        More inputs to judge.
    page, beside, skeleton
        As for the report of an arm.
    """
    quiet_backend()
    started = time.monotonic()
    found = analyze_mechanism(mechanism)
    if found.missing:  # Ctrl-C
        raise KeyboardInterrupt
    special = tuple(_special(mechanism, found, poses))
    shown = _page(mechanism, found, skeleton) if page or beside is not None else None
    sections = [
        summary(mechanism, found),
        robot(mechanism, found),
        assumed(found),
        modes(mechanism, found),
        maps(mechanism),
        aspects(mechanism, found),
        loci(mechanism, found),
        points(mechanism, found),
        verdicts(mechanism, special),
        sure(found),
        model(shown if page and shown is not None else None, beside if shown is not None else None),
    ]
    made = Made.since(started)
    sections += [computed(made, "Pinocchio", []), words(), data(SCHEMA)]
    html = document(
        title=f"Singular configurations of {mechanism.name}",
        subtitle=f"driven by {', '.join(mechanism.inputs)}; {made.when}",
        sections=[s for s in sections if s is not None],
        data={
            "schema": SCHEMA,
            "made": made.when,
            "seconds": made.seconds,
            "versions": dict(made.versions),
            "mechanism": result(found),
            "special": [
                {
                    "name": s.name,
                    "inputs": s.inputs.tolist(),
                    "states": [result(x) for x in s.states],
                }
                for s in special
            ],
        },
        page=shown if page else None,
        foot=f"Made by pinsing {__version__}.",
    )
    return html, shown


def _page(mechanism: Mechanism, found: MechanismAnalysis, skeleton: bool) -> str:
    from pinsing.view.mechanism.viewer import MechanismViewer

    with MechanismViewer(mechanism, found, skeleton=skeleton) as viewer:
        return viewer.html()


def _special(
    mechanism: Mechanism, found: MechanismAnalysis, poses: Mapping[str, Array]
) -> Iterator[SpecialInputs]:
    actuated = list(mechanism.actuated)
    lower, upper = mechanism.lower[actuated], mechanism.upper[actuated]
    ends = np.isfinite(lower) & np.isfinite(upper)
    middle = np.where(ends, (np.where(ends, lower, 0) + np.where(ends, upper, 0)) / 2, 0.0)
    named = {"home": found.state.inputs, "zero": np.zeros(len(actuated)), "mid-range": middle}
    if not ends.any():
        del named["mid-range"]  # without limits there is no middle
    elif np.array_equal(named["zero"], middle):
        del named["mid-range"]
        named = {("zero, which is mid-range" if k == "zero" else k): v for k, v in named.items()}
    for key, inputs in {**named, **poses}.items():
        if key == "home":
            yield SpecialInputs(key, inputs, (found.state,), "")
            continue
        beyond = [
            name
            for name, v, low, high in zip(mechanism.inputs, inputs, lower, upper, strict=True)
            if not low - SLACK <= v <= high + SLACK
        ]
        if beyond:
            why = f"{', '.join(beyond)}: beyond the limits"
            yield SpecialInputs(key, inputs, (), why, "outside the limits")
            continue
        try:
            closed = assemblies(mechanism, inputs)
        except InfeasibleError as problem:
            yield SpecialInputs(key, inputs, (), str(problem))
            continue
        yield SpecialInputs(key, inputs, tuple(mechanism_at(mechanism, s.q) for s in closed), "")
