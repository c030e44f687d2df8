"""A mechanism's analysis in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pinsing.mechanism.analysis import MechanismAnalysis

_MEANING = {
    "type 1": "a direction of the output is lost",
    "type 2": "the output moves with the actuators held",
    "type 3": "both",
    "constraint": "more motions than the mobility",
}


def analysis_text(a: MechanismAnalysis) -> str:
    """Plain text of an analysis, radians and metres."""
    redundant = a.constraint_rows - a.constraint_rank
    spare = f", {redundant} of {a.constraint_rows} redundant" if redundant else ""
    out = [
        f"{a.name}: {len(a.joints)} joints, {a.mobility} degrees of freedom "
        f"({a.constraint_rank} independent closure equations{spare})",
        f"  driven by {', '.join(a.inputs)}; output {a.output} ({a.task}); "
        f"loops {', '.join(a.loops)}; length scale {a.length_scale:g} m",
        "",
        f"At {_named(a.inputs, a.state.inputs)}: {a.state.kind}"
        + (" (near-singular)" if a.state.near else ""),
        f"  measures: type 1 {a.state.output_ratio:.4g}, type 2 {a.state.input_ratio:.4g}, "
        f"constraint {a.state.constraint_ratio:.4g}",
        f"  {len(a.assemblies)} assembly configurations at these inputs:",
        *(f"    {s.mode}: {_named(a.joints, s.q)}" for s in a.assemblies),
    ]
    if a.working:
        out.append(f"  {len(a.working)} ways to reach the same output position:")
        out += [f"    {m.name}: {_named(a.joints, m.q)}" for m in a.working]
    out.append("  the loops close, the other inputs held, for")
    out += [
        f"    {name} in {' or '.join(str(i) for i in found) or 'nothing'}"
        for name, found in a.ranges.items()
    ]
    for kind in ("type 1", "type 2", "type 3", "constraint"):
        here = [p for p in a.points if p.kind == kind]
        if not here:
            continue
        out += ["", f"{kind} ({_MEANING[kind]}), along the curves through these inputs:"]
        for p in here:
            end = "  end of the range" if p.range_end else ""
            out.append(f"  {_named(a.inputs, p.inputs, 10)}  {p.mode}{end}")
    out.append("")
    if a.forms is None:
        out.append("Closed forms: none (no planar dyad closes the loops); the points are numeric.")
    else:
        whole = "all" if a.forms.complete else "not all"
        out.append(f"Closed forms ({whole} singular loci over the inputs, in m²):")
        for locus in a.forms.loci:
            extra = "  [isolated points]" if locus.points_only else ""
            extra += "" if locus.witness else "  [no feasible configuration found]"
            out += [f"  {locus.kind}: {locus.words}{extra}", f"    {locus.equation}"]
        out += [f"  {note}" for note in a.forms.notes]
    out += [f"{'ok' if c.passed else 'DISAGREES'}: {c.words}" for c in a.checks]
    out += [f"note: {note}" for note in a.notes]
    return "\n".join(out)


def _named(names: tuple[str, ...], values: np.ndarray, digits: int = 6) -> str:
    return ", ".join(f"{n} = {v:.{digits}g}" for n, v in zip(names, values, strict=True))
