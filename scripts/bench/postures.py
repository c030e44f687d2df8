"""Count the aspects of the table of arms, and look which are cuspidal.

python scripts/bench/postures.py [ARM ...]
python scripts/bench/postures.py --write
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from closed_form import ARMS

import pinsing
from pinsing.errors import PinsingError
from pinsing.kinematics.jacobian import generic_rank
from pinsing.robot.arm import Arm

MORE = {
    "UR3": {"robot": "ur3"},
    "UR3, joints limited": {"robot": "ur3_limited"},
    "UR5, joints limited": {"robot": "ur5_limited"},
    "UR10, joints limited": {"robot": "ur10_limited"},
    "SO-100": {"robot": "so100"},
    "KUKA iiwa 14, joint 3 locked": {
        "robot": "iiwa14",
        "joints": ["q1", "q2", "q4", "q5", "q6", "q7"],
    },
}
"""Arms that the table of closed forms does not list."""

HEAD = """name: {name}
convention: standard
units: {{angle: deg, length: m}}
source: "{source}"
rows:
"""
ROW = "  - {{alpha: {}, a: {}, d: {}, theta: {}, type: revolute, limits: [-180, 180]}}\n"
TABLES = {
    "Fanuc CRX-10iA/L": (
        "Elias and Wen, arXiv 2501.18505",
        "pose",
        [
            (-90, 0, 0.245, 0),
            (0, 0.71, 0, -90),
            (-90, 0, 0, 0),
            (90, 0, 0.54, 0),
            (-90, 0, -0.15, 0),
            (0, 0, 0.16, 0),
        ],
    ),
    "ABB GoFa 5": (
        "Elias and Wen, arXiv 2501.18505",
        "pose",
        [
            (-90, 0, 0.265, 0),
            (0, 0.444, 0, -90),
            (-90, 0.11, 0, 0),
            (90, 0, 0.47, 0),
            (-90, 0.08, 0, 0),
            (0, 0, 0.101, 180),
        ],
    ),
    "orthogonal 3R (1, 2, 1.5, 1)": (
        "after Wenger",
        "position",
        [(-90, 1, 0, 0), (90, 2, 1, 0), (0, 1.5, 0, 0)],
    ),
    "orthogonal 3R (1, 2, 0.2, 1)": (
        "after Wenger",
        "position",
        [(-90, 1, 0, 0), (90, 2, 1, 0), (0, 0.2, 0, 0)],
    ),
    "orthogonal 3R (1, 2, 1.5, 0)": (
        "after Wenger",
        "position",
        [(-90, 1, 0, 0), (90, 2, 0, 0), (0, 1.5, 0, 0)],
    ),
}


def arms(names: list[str]) -> dict[str, Arm]:
    """The arms of the table by name."""
    out = {}
    for name, words in {**ARMS, **MORE}.items():
        if not names or name in names:
            options = {k: v for k, v in words.items() if k != "robot"}
            out[name] = pinsing.load(words["robot"], **options)
    for name, (source, task, rows) in TABLES.items():
        if not names or name in names:
            with tempfile.TemporaryDirectory() as folder:
                path = Path(folder, "arm.dh.yaml")
                plain = "".join(c if c.isalnum() else "_" for c in name).lower()
                text = HEAD.format(name=plain, source=source)
                path.write_text(text + "".join(ROW.format(*row) for row in rows))
                out[name] = pinsing.load(path, task=task)
    return out


def count(form: pinsing.ClosedForm, limits: bool) -> tuple[str, str]:
    """A count and the milliseconds of processor time that it took."""
    begin = time.process_time()
    found = pinsing.aspects(form, limits)
    taken = f"{1e3 * (time.process_time() - begin):.0f}"
    if found.proven:
        return str(found.lower), taken
    return f"{found.lower} to {'?' if found.upper is None else found.upper}", taken


def row(name: str, arm: Arm, poses: int) -> str:
    """One line of the table."""
    form = pinsing.closed_form(arm)
    word = "no" if not form.complete else "yes"
    if form.complete and form.proof is not None and form.proof.accepted:
        word = "proven"
    around, around_ms = count(form, False)
    within, within_ms = count(form, True)
    cuspidal = ""
    if arm.n == generic_rank(arm):
        try:
            found = pinsing.cuspidality(arm, forms=form, poses=poses)
        except PinsingError as error:
            cuspidal = str(error)
        else:
            cuspidal = found.answer + (", proven" if found.proven else f" in {found.poses} poses")
    return (
        f"| {name} | {arm.n} | {word} | {around} | {around_ms} | {within} | {within_ms} "
        f"| {cuspidal} |"
    )


def main() -> None:
    """Print or write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("arms", nargs="*")
    parser.add_argument("--poses", type=int, default=60)
    parser.add_argument("--write", action="store_true", help="the table in docs/postures.md")
    options = parser.parse_args()
    lines = [
        "| arm | joints | families | aspects on circles | ms | within limits | ms | cuspidal |",
        "| --- | ---: | --- | ---: | ---: | ---: | ---: | --- |",
    ]
    for name, arm in arms(options.arms).items():
        lines.append(row(name, arm, options.poses))
        print(lines[-1], flush=True)
    if options.write:
        page = Path(__file__).resolve().parents[2] / "docs" / "postures.md"
        head = page.read_text(encoding="utf-8").partition("| arm |")[0]
        page.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
