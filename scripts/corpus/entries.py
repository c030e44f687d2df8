"""What the corpus holds of one chain, mechanism or command, and what a change of it means.

Answers are kept as data that outlive the code that gave them: points on each family, singular
points found without it, numbers and words. Seeds are made of the entry's key, so that the same
code gives the same entry.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "scripts" / "bench")]

SEEDS = 500
POINTS = 6
ON = 1e-6
"""A point of a family is within this of it, radians or metres over the length scale."""
SINGULAR = 1e-6
"""Least singular value over the usual largest one, where the file's own geometry is singular."""
WORSE = 1e-2
"""A bound that is weaker by less than this share of itself is no loss: searches end there."""
WORDS = ("not complete", "probable", "proven")
COMMANDS = {
    "families": "families ur5",
    "families-loops": "families five_bar --loops",
    "analyze": "analyze planar3r",
    "analyze-loops": "analyze four_bar --loops",
    "aspects": "postures --aspects scara",
    "at": "at ur5 --q 0,-1.2,0.1,-1,-1.5,0",
    "check": "check ur5 path.csv",
    "cuspidal": "postures --cuspidal scara",
    "dh": "export --urdf table.yaml -o table.urdf",
    "export": "export ur5 -o guard.py",
    "info": "list --info panda",
    "line": "line ur5 --q 10,-70,75,-90,-80,0 --deg --to 0.3,0.2,0.5",
    "list": "list",
    "map": "map scara --count 1000",
    "plot": "plot curves planar3r -o plot.png",
    "postures": "postures ur5 --q 0,-1.2,0.9,-1,-1.5,0",
    "report": "report scara -o report.html",
    "suggest": "at --suggest ur5",
    "sweep": "analyze --sweep planar3r --deg",
    "verify": "verify proof.cert.json",
    "view": "view ur5 --help",
}


def keys() -> Iterator[str]:
    """All entries: ``data FILE TIP [BASE]``, ``task ARM|TASK``, ``seed N``, ``loops NAME``, ..."""
    from oracle.survey import jobs
    from tasks import POSITIONS, TASKS

    yield from (f"loops {p.name.split('.')[0]}" for p in sorted(ROOT.glob("urdf/*.loops.yaml")))
    yield from (f"task {arm}|{task}" for arm in _table_names() for task in TASKS)
    yield from (f"task {arm}|position" for arm in POSITIONS)
    yield from (f"data {job.key}" for job in jobs()[0])
    yield from (f"seed {k}" for k in range(SEEDS))
    yield from (f"command {name}" for name in COMMANDS)


def entry(key: str, patience: float, before: dict[str, Any] | None = None) -> dict[str, Any]:
    """Compute an entry; with one of before, also what became of its points, as ``kept``.

    Searches that are capped by the clock have ``patience`` times their seconds.
    """
    from pinsing.errors import PinsingError

    kind, rest = key.split(" ", 1)
    started = time.monotonic()
    try:
        if kind == "command":
            out = _transcript(rest)
        elif kind == "loops":
            out = _mechanism(rest, before)
        else:
            out = _arm(key, patience, before)
    except PinsingError as error:
        out = {"outcome": "refused", "text": _plain(str(error))}
    return {"key": key, "outcome": "done", **out, "seconds": round(time.monotonic() - started, 2)}


def _rng(key: str) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(key.encode()))


def _rounded(x: Any, digits: int = 12) -> Any:
    """Numbers for JSON; infinity as text."""
    values = np.round(np.ravel(x).astype(float), digits).tolist()
    return [v if np.isfinite(v) else str(v) for v in values]


# -- arms ---------------------------------------------------------------------------------------


@cache
def _tables() -> dict[str, Any]:
    from tasks import arms

    return dict(arms())


def _table_names() -> list[str]:
    from tasks import LOADED, OFFSET_WRISTS, PUBLISHED, TOOLS

    return [*LOADED, *OFFSET_WRISTS, *PUBLISHED, *(f"{n}, a tool off the flange" for n in TOOLS)]


def _load(key: str) -> Any:
    from oracle.chains import arm_of, random_spec
    from tasks import POSITIONS

    import pinsing
    from pinsing.description.catalog import data_folder

    kind, rest = key.split(" ", 1)
    if kind == "seed":
        return arm_of(random_spec(int(rest)))
    if kind == "task":
        name, task = rest.split("|")
        if name in POSITIONS:
            options = dict(POSITIONS[name])
            return pinsing.load(options.pop("robot"), task=task, **options)
        return _tables()[name].with_task(task)
    folder = data_folder()
    assert folder is not None, "example-robot-data is not installed"
    file, tip, *base = rest.split(" ")
    return pinsing.load(folder / file, tip=tip, base=base[0] if base else None)


def _arm(key: str, patience: float, before: dict[str, Any] | None) -> dict[str, Any]:
    import pinsing

    arm, rng = _load(key), _rng(key)
    form = pinsing.closed_form(arm, seconds=10 * patience)
    families = []
    for family in form.families:
        points = family.points(POINTS, _rng(f"{key} {family.text}")) if family.real else []
        families.append(
            {
                "text": family.text,
                "codimension": family.codimension,
                "kinds": _kinds([family]),
                "real": family.real,
                "reach": family.reachability,
                "points": [_rounded(q) for q in points],
            }
        )
    Q = rng.uniform(-3, 3, (POINTS, arm.n))
    out: dict[str, Any] = {
        "word": form.word,
        "gaps": list(form.gaps),
        "rank": form.generic_rank,
        "families": families,
        "singular": _found_singular(arm, form, Q),
        "regular": _regular(arm, form, np.array([q for f in families for q in f["points"]])),
    }
    if form.families:
        near = pinsing.clearance(form, Q)
        sure = pinsing.clearance(form, Q[:2], certify=True)
        out["bounds"] = {
            "lower": _rounded(near.lower, 9),
            "upper": _rounded(near.upper, 9),
            "sure lower": _rounded(sure.lower, 9),
            "sure upper": _rounded(sure.upper, 9),
        }
        for limits in (True, False):
            count = pinsing.aspects(form, limits)
            out[f"aspects {'within limits' if limits else 'on circles'}"] = [
                count.lower,
                count.upper,
            ]
    if before is not None:
        out["kept"] = _kept(form, before)
    return out


def _kinds(families: list[Any]) -> list[str]:
    return sorted({k for f in families for k in {p.kind for p in f.kinds} or {f.kind}})


def _found_singular(arm: Any, form: Any, Q: np.ndarray) -> list[dict[str, Any]]:
    """Singular configurations found from random starts, without the families; codimension there."""
    import pinsing

    found = pinsing.kinematics.refine_many(arm, Q, ignore_limits=True)
    points = [s.q for s in found if s.status == "singular"]
    return [{"q": _rounded(q), "codimension": _least(form, np.array(q))} for q in points]


def _least(form: Any, q: np.ndarray) -> int | None:
    """Least codimension of the families with a point at q; None where there is none."""
    on = [f.codimension for f in form.families if f.real and bool(f.contains(q, ON))]
    return min(on, default=None)


def _kept(form: Any, before: dict[str, Any]) -> dict[str, Any]:
    """For all points of an earlier answer the least codimension here; kinds where they lie."""
    kinds = []
    for old in before.get("families", ()):
        q = np.array(old["points"])
        same = [
            f
            for f in form.families
            if len(q) and f.real and f.codimension == old["codimension"] and f.contains(q, ON).any()
        ]
        kinds.append(_kinds(same))
    return {
        "families": [
            [_least(form, np.array(q)) for q in old["points"]] for old in before.get("families", ())
        ],
        "kinds": kinds,
        "singular": [_least(form, np.array(s["q"])) for s in before.get("singular", ())],
    }


def _regular(arm: Any, form: Any, Q: np.ndarray) -> int:
    """How many points of the families are regular, by Pinocchio's own Jacobian.

    There are some where the exact chain is not the file's: angles that were put to simple ones.
    """
    import pinsing

    if not len(Q):
        return 0
    usual = np.random.default_rng(0).uniform(-3, 3, (20, arm.n))
    least = pinsing.singular_values(arm, Q)[:, form.generic_rank - 1]
    return int((least > SINGULAR * np.median(pinsing.singular_values(arm, usual)[:, 0])).sum())


# -- mechanisms ---------------------------------------------------------------------------------


def _mechanism(name: str, before: dict[str, Any] | None) -> dict[str, Any]:
    from pinsing.loops import analyze_mechanism, joint_forms, mechanism_at
    from pinsing.robot.mechanism import load_mechanism

    mechanism = load_mechanism(ROOT / "urdf" / f"{name}.urdf")
    found = analyze_mechanism(mechanism)
    forms = {"inputs": found.forms, "pose": found.pose_forms, "joints": found.joint_forms}
    over = joint_forms(mechanism)

    def on(q: np.ndarray) -> list[str]:
        """Kind there by Pinocchio, and the kinds of the loci that say so."""
        said = [x.kind for x in over.loci if float(x.ratio(q, over.joints)) <= ON]
        if found.forms is not None:
            at = q[list(mechanism.actuated)]
            said += [
                f"{x.kind} over inputs"
                for x in found.forms.loci
                if abs(float(x.equation(at))) <= 1e-9 * x.equation.size
            ]
        return [mechanism_at(mechanism, q).kind, *sorted(set(said))]

    points = [{"q": _rounded(p.q), "kind": p.kind, "on": on(np.array(p.q))} for p in found.points]
    out: dict[str, Any] = {
        "rank": [found.mobility, found.constraint_rank],
        "complete": {k: f is not None and f.complete for k, f in forms.items()},
        "loci": {
            k: sorted(f"{x.kind}, {x.words}" for x in f.loci) if f is not None else []
            for k, f in forms.items()
        },
        "modes": {"assembly": len(found.assemblies), "working": len(found.working)},
        "statements": [found.direct, found.inverse],
        "checks": [sum(c.passed for c in found.checks), len(found.checks)],
        "missing": list(found.missing),
        "points": points,
    }
    if before is not None:
        out["kept"] = [on(np.array(p["q"])) for p in before.get("points", ())]
    return out


# -- commands -----------------------------------------------------------------------------------


def _transcript(name: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        t = np.linspace(0, 1, 21)
        rows = [f"{x:.2f},{2 * x - 1:.4f},-1.2,{1.2 - 1.5 * x:.4f},-1,-1.5,0" for x in t]
        (here / "path.csv").write_text(
            "time,shoulder_pan_joint,shoulder_lift_joint,elbow_joint,wrist_1_joint,wrist_2_joint,"
            "wrist_3_joint\n" + "\n".join(rows) + "\n"
        )
        (here / "table.yaml").write_text((ROOT / "urdf" / "scara.dh.yaml").read_text())
        if name == "verify":
            _run("families scara -o proof.cert.json", here)
        code, text = _run(COMMANDS[name], here)
        files = sorted(p.name for p in here.iterdir())
    return {"text": _plain(text.replace(folder, "FOLDER")), "exit": code, "files": files}


def _run(words: str, folder: Path) -> tuple[int, str]:
    env = {**os.environ, "COLUMNS": "100", "NO_COLOR": "1", "MPLBACKEND": "agg"}
    done = subprocess.run(
        [sys.executable, "-m", "pinsing", *words.split()],
        cwd=folder, env=env, capture_output=True, text=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout + done.stderr


def _plain(text: str) -> str:
    """Without times, rates and places of files."""
    text = re.sub(r"engine \w+", "engine E", text)
    text = text.replace(str(ROOT), "ROOT").replace(str(Path.home()), "HOME")
    number = r"\d[\d.,]*(e[+-]?\d+)?"
    return re.sub(rf"{number} ?(ns|µs|ms|s|MB|min|/s|per second)\b", "(measured)", text)


# -- what a change means ------------------------------------------------------------------------


def changes(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Losses, gains and what is to be reviewed: (sort, words)."""
    if old["outcome"] != new["outcome"]:
        worse = old["outcome"] == "done" or new["outcome"] in ("crashed", "killed")
        sort = "loss" if worse else "gain"
        yield sort, f"{old['outcome']} became {new['outcome']}: {new.get('text', '')[-200:]}"
        return
    if old["outcome"] != "done" or "text" in old:
        for what in ("exit", "files"):
            if old.get(what) != new.get(what):
                yield "loss", f"{what} {old.get(what)} became {new.get(what)}"
        if old.get("text") != new.get("text"):
            yield "review", "the text differs"
        return
    if old["rank"] != new["rank"]:
        yield "loss", f"generic rank {old['rank']} became {new['rank']}"
    yield from (_of_mechanism if "loci" in old else _of_arm)(old, new)


def _of_arm(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, str]]:
    before, now = (WORDS.index(x["word"]) for x in (old, new))
    if before != now:
        yield "loss" if now < before else "gain", f"{old['word']} became {new['word']}"
    # An answer that is not complete holds for what it knew: other families may be nearer, and what
    # is left open by a search that got farther is not the same.
    farther = before == 0 and (now > 0 or len(new["families"]) > len(old["families"]))
    less = "review" if farther else "loss"
    if len(old["gaps"]) != len(new["gaps"]):
        more = len(new["gaps"]) > len(old["gaps"])
        yield less if more else "gain", f"{len(old['gaps'])} gaps became {new['gaps']}"
    kept = new["kept"]
    for f, least, kinds in zip(old["families"], kept["families"], kept["kinds"], strict=True):
        name = f"{f['text'][:60]} ({f['codimension']})"
        lost = sum(c is None for c in least)
        if lost:
            yield "loss", f"{lost} of {len(least)} points of {name} are on no family"
        deeper = sorted({c for c in least if c is not None and c > f["codimension"]})
        if deeper:
            yield "loss", f"points of {name} are on families of codimension {deeper} alone"
        gone = set(f["kinds"]) - set(kinds)
        if f["points"] and not lost and not deeper and gone:
            wider = min(least) < f["codimension"]
            sort = "gain" if gone == {"undecided"} else less if wider else "loss"
            yield sort, f"{name}: kinds {f['kinds']} became {kinds}"
    for s, c in zip(old["singular"], kept["singular"], strict=True):
        if s["codimension"] != c:
            sort = "gain" if s["codimension"] is None else "loss"
            yield sort, f"singular point {s['q']}: least codimension {s['codimension']} became {c}"
    # What is stated now must be singular: then it lies in an old answer that was complete.
    if new["regular"] != old["regular"]:
        sort = "loss" if new["regular"] > old["regular"] else "gain"
        yield sort, f"points of families that are regular: {old['regular']} became {new['regular']}"
    for which in ("real", "reach"):
        yield from _counted(old, new, which)
    for name in ("aspects within limits", "aspects on circles"):
        low, high = old.get(name, (1, None))
        yield from _bounds(name, low, high, *new.get(name, (1, None)), 0, less)
    for name in ("", "sure "):
        one, two = (x.get("bounds", {}) for x in (old, new))
        pairs = (one.get(f"{name}{k}", []) for k in ("lower", "upper"))
        now_pairs = (two.get(f"{name}{k}", []) for k in ("lower", "upper"))
        for a, b in zip(zip(*pairs, strict=True), zip(*now_pairs, strict=True), strict=False):
            yield from _bounds(f"{name}clearance", *map(float, a), *map(float, b), WORSE, less)
        if one and not two:
            yield "loss", "there are no clearances"


def _counted(old: dict[str, Any], new: dict[str, Any], which: str) -> Iterator[tuple[str, str]]:
    """What families say of themselves, each way of it that has gone or come."""
    before, now = ({str(f[which]) for f in x["families"]} for x in (old, new))
    if before != now:
        sort = "loss" if before - now else "review"
        yield sort, f"families' {which}: {sorted(before)} became {sorted(now)}"


def _bounds(
    name: str, low: Any, high: Any, now_low: Any, now_high: Any, slack: float, less: str
) -> Iterator[tuple[str, str]]:
    """Of one number, before and now: None or infinity is no upper bound; weaker is ``less``."""
    top, now_top = (np.inf if x is None else x for x in (high, now_high))
    words = f"{name}: {low} to {high} became {now_low} to {now_high}"
    least = 1e-8 + slack * (low if np.isfinite(low) else 0)
    most = 1e-8 + slack * (top if np.isfinite(top) else 0)
    if now_low > top + 1e-8 or now_top < low - 1e-8:
        yield less, f"{words}: they contradict each other"
    elif now_low < low - least or now_top > top + most:
        yield less, words
    elif now_low > low + least or now_top < top - most:
        yield "gain", words


def _of_mechanism(old: dict[str, Any], new: dict[str, Any]) -> Iterator[tuple[str, str]]:
    for k, was in old["complete"].items():
        if was != new["complete"][k]:
            yield "loss" if was else "gain", f"over the {k} complete: {was} became {not was}"
    for k, count in old["modes"].items():
        if count != new["modes"][k]:
            sort = "loss" if new["modes"][k] < count else "gain"
            yield sort, f"{count} {k} modes became {new['modes'][k]}"
    if new["checks"][0] < new["checks"][1]:
        yield "loss", f"{new['checks'][1] - new['checks'][0]} of its own checks disagree"
    if len(new["missing"]) != len(old["missing"]):
        sort = "loss" if len(new["missing"]) > len(old["missing"]) else "gain"
        yield sort, f"missing: {new['missing']}"
    for p, on in zip(old["points"], new["kept"], strict=True):
        if p["on"][0] != on[0]:
            yield "loss", f"at {p['q']}: {p['on'][0]} became {on[0]}"
        if set(p["on"][1:]) != set(on[1:]):
            sort = "loss" if set(p["on"][1:]) - set(on[1:]) else "gain"
            yield sort, f"at {p['q']}: on loci of {p['on'][1:]} became {on[1:]}"
    for k in ("loci", "statements"):
        if old[k] != new[k]:
            yield "review", f"{k} differ: {old[k]} became {new[k]}"
    counts = [len(x["points"]) for x in (old, new)]
    if counts[0] != counts[1]:
        yield ("loss" if counts[1] < counts[0] else "gain"), f"singular points: {counts}"
