"""Time closed forms, arm by arm, and Sympy on the same determinants.

    python scripts/bench/closed_form.py [ARM ...] [--sympy-limit 20] [--no-sympy]
    python scripts/bench/closed_form.py --write docs/closed_forms.md
    python scripts/bench/closed_form.py --check docs/closed_forms.md
    python scripts/bench/closed_form.py --functions ur5

``--write`` puts the table of arms and families into a file, ``--check`` fails if the file
says anything but what comes out now (times aside). ``--functions`` counts what a reader of one
closed form has to read: the named functions of pinsing that it passes through, module by module.

Sympy gets two tasks, each in a process of its own that is ended at the limit:

*trigonometric*: the way of textbooks and of the paper. The Jacobian of the nominal geometry
with exact rational lengths, in sines and cosines; its determinant (of J J^T or J^T J where J
is not square), simplified and factored.

*polynomial*: the very polynomials that pinsing works on (half-angle coordinates, a frame in
the middle of the chain): the first maximal minor, by Sympy's own dense matrices over a
polynomial ring, and its factors. One minor; a redundant arm has seven, and to branch on
their factors comes on top.
"""

from __future__ import annotations

import argparse
import importlib.util
import multiprocessing
import platform
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from queue import Empty
from types import CodeType, FrameType
from typing import Any, NamedTuple

import pinsing
from pinsing.algebra.budget import Budget
from pinsing.algebra.jacobian_matrix import dependent, jacobian_matrix
from pinsing.algebra.ring import make_ring
from pinsing.families import ClosedForm, closed_form, prove
from pinsing.families.certificate import text_of
from pinsing.proof.checker import verify
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import Nominal, nominal

ARMS: dict[str, dict[str, str]] = {
    "Stanford arm": {"robot": "stanford"},
    "PUMA 560": {"robot": "puma560"},
    "ABB IRB 1400": {"robot": "irb1400"},
    "planar 3R, position": {"robot": "planar3r", "task": "position"},
    "SCARA": {"robot": "scara"},
    "UR5": {"robot": "ur5"},
    "UR10": {"robot": "ur10"},
    "Kinova Jaco j2s6s200": {"robot": "kinova"},
    "Unitree Z1": {"robot": "z1"},
    "SO-101": {"robot": "so101"},
    "Talos, left arm of 6 joints": {"robot": "talos_arm"},
    "surgical arm of 7 joints": {"robot": "surgical7"},
    "KUKA iiwa 14": {"robot": "iiwa14"},
    "Franka Panda": {"robot": "panda"},
    "UFACTORY xArm 7": {"robot": "xarm7"},
    "PR2, right arm": {"robot": "pr2", "tip": "r_gripper_tool_frame", "base": "torso_lift_link"},
    "Romeo, left arm": {"robot": "romeo", "tip": "l_wrist", "base": "torso"},
    "iCub, left arm": {"robot": "icub", "tip": "l_hand", "base": "chest"},
    "iCub, right arm": {"robot": "icub", "tip": "r_hand", "base": "chest"},
    "Talos, left arm of 7 joints": {
        "robot": "talos_full_v2",
        "tip": "gripper_left_base_link",
        "base": "torso_2_link",
    },
    "Tiago": {"robot": "tiago", "tip": "arm_tool_link", "base": "torso_lift_link"},
    "Tiago Pro, left arm": {
        "robot": "tiago_pro",
        "tip": "arm_left_tool_link",
        "base": "torso_lift_link",
    },
    "Baxter, left arm": {"robot": "baxter", "tip": "left_gripper"},
    "Unitree G1, left arm": {"robot": "g1", "tip": "left_rubber_hand", "base": "torso_link"},
}


# Sympy ----------------------------------------------------------------------------------


def trigonometric(geometry: Nominal, rows: Sequence[int]) -> object:
    """Determinant of the Jacobian in sines and cosines, simplified and factored."""
    import sympy

    n = len(geometry.prismatic)
    q = sympy.symbols(f"q1:{n + 1}", real=True)

    def rational(x: Fraction) -> Any:
        return sympy.Rational(x.numerator, x.denominator)

    def placed(i: int) -> Any:
        T = sympy.eye(4)
        for a in range(3):
            for b in range(3):
                T[a, b] = rational(geometry.rotation[i][a][b])
            T[a, 3] = rational(geometry.translation[i][a])
        return T

    T = sympy.eye(4)
    axes, points = [], []
    for j in range(n):
        T = T * placed(j)
        axes.append(T[:3, 2])
        points.append(T[:3, 3])
        move = sympy.eye(4)
        if geometry.prismatic[j]:
            move[2, 3] = q[j]
        else:
            c, s = sympy.cos(q[j]), sympy.sin(q[j])
            move[:2, :2] = sympy.Matrix([[c, -s], [s, c]])
        T = T * move
    tip = (T * placed(n))[:3, 3]
    columns = [
        z.col_join(sympy.zeros(3, 1)) if slides else z.cross(tip - p).col_join(z)
        for z, p, slides in zip(axes, points, geometry.prismatic, strict=True)
    ]
    J = sympy.Matrix.hstack(*columns).extract(list(rows), list(range(n)))
    J = J.extract([i for i in range(J.rows) if any(J.row(i))], list(range(n)))
    if J.rows == J.cols:
        determinant = J.det()
    else:
        determinant = (J * J.T if J.rows < J.cols else J.T * J).det()
    return sympy.factor(sympy.simplify(determinant))


def polynomial(geometry: Nominal, rows: Sequence[int]) -> object:
    """First maximal minor of the matrix of polynomials, and its factors."""
    from sympy import QQ, ring
    from sympy.polys.matrices import DomainMatrix

    own = make_ring(geometry.prismatic)
    matrix = jacobian_matrix(geometry, own, geometry.arm.task, Budget(60.0))
    gone = dependent(matrix, own)
    matrix = [row for i, row in enumerate(matrix) if i not in gone]
    domain, *_ = ring(own.context.names(), QQ)
    size = min(len(matrix), len(matrix[0]))

    def convert(poly: Any) -> Any:
        terms = {
            tuple(int(k) for k in monomial): QQ(int(c.p), int(c.q))
            for monomial, c in poly.to_dict().items()
        }
        return domain.from_dict(terms)

    table = [[convert(x) for x in row[:size]] for row in matrix[:size]]
    minor = DomainMatrix(table, (size, size), domain.to_domain()).det()
    return minor.factor_list()


def work(
    task: Callable[[Nominal, Sequence[int]], object], chosen: dict[str, str], answers: Any
) -> None:
    """Body of the child process: the time without imports and loading."""
    import sympy  # noqa: F401

    geometry = nominal(load(**chosen))
    rows = geometry.arm.task.rows
    started = time.perf_counter()
    task(geometry, rows)
    answers.put(time.perf_counter() - started)


def limited(
    task: Callable[[Nominal, Sequence[int]], object], chosen: dict[str, str], limit: float
) -> str:
    """Seconds that Sympy needs, or that it did not end in time."""
    context = multiprocessing.get_context("spawn")
    answers = context.Queue()
    child = context.Process(target=work, args=(task, chosen, answers), daemon=True)
    child.start()
    try:
        return f"{answers.get(timeout=limit + 5):.2f} s"  # 5 s: starting Python and Sympy
    except Empty:
        return f"> {limit:g} s" if child.is_alive() else "failed"
    finally:
        child.kill()
        child.join()


# Tables ---------------------------------------------------------------------------------


class Times(NamedTuple):
    """Processor seconds: the closed form (the least of all rounds), its proof, and the check."""

    answer: float
    proof: float
    check: float


def processor() -> float:
    """Processor seconds of this process and of children that have ended."""
    used = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(u.ru_utime + u.ru_stime for u in used)


def timed(arm: Arm, rounds: int) -> tuple[ClosedForm, Times]:
    """A closed form with its proof, and what they took."""
    answers = []
    for _ in range(rounds):
        started = processor()
        form = closed_form(arm, seconds=PATIENCE, prove=False)
        answers.append(processor() - started)
    started = processor()
    form = prove(form, PATIENCE)
    proof, check = processor() - started, 0.0
    if form.certificate is not None:
        text, started = text_of(form.certificate), processor()
        verify(text)
        check = processor() - started
    return form, Times(min(answers), proof - check, check)


def table(rows: Sequence[Sequence[str]], head: Sequence[str]) -> str:
    """Markdown table, columns aligned."""
    width = [max(len(line[i]) for line in [head, *rows]) for i in range(len(head))]
    lines = [[x.ljust(w) for x, w in zip(line, width, strict=True)] for line in [head, *rows]]
    lines.insert(1, ["-" * w for w in width])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def families_row(name: str, arm: Arm, form: ClosedForm, times: Times) -> list[str]:
    codimensions = sorted(f.codimension for f in form.families)
    counts = ", ".join(
        f"{codimensions.count(c)} of codimension {c}" for c in sorted(set(codimensions))
    )
    inside = sum(f.reachability == "reachable" for f in form.families)
    change = form.jacobian_change
    return [
        name,
        str(arm.n),
        str(form.generic_rank),
        f"{len(form.families)} ({counts})",
        str(inside),
        form.word,
        "yes" if form.fully_decomposed else "no",
        "exact" if change <= 1e-12 else f"{change:.0e}",
        f"{form.proof.size / 1e3:.1f} kB" if form.proof and form.proof.size else "none",
        f"{1000 * times.answer:.0f} ms",
        f"{times.proof:.2f} s",
        f"{1000 * times.check:.0f} ms" if times.check else "none",
    ]


HEAD = [
    "arm",
    "joints",
    "rank",
    "families",
    "reachable",
    "complete",
    "fully decomposed",
    "geometry moved",
    "certificate",
    "time",
    "proof",
    "check",
]
PATIENCE = 300.0
"""Seconds on the clock that an answer and a proof may take, on a busy machine too."""
TIMES = 3
"""Columns at the end that are times."""

PAGE = """# Closed forms, arm by arm

Written by `python scripts/bench/closed_form.py --write docs/closed_forms.md`;
`--check` instead of `--write` fails if anything but a time has changed.
Chains from foot to hand, planar arms of many links and positions: [long_chains.md](long_chains.md).
Tasks of four and five rows of six-joint arms: [tasks.md](tasks.md).

*Families*: components of the real singular set over whole circles, mirror images joined.
*Reachable*: how many of them have a configuration inside the joint limits.
*Complete*: proven (there is a certificate, and the checker accepted it), probable, or not complete;
see [proof.md](proof.md).
*Fully decomposed*: every family has joint values and at most one equation; else one family
is left as a system of equations.
*Geometry moved*: bound of the change of any column of the Jacobian that rounding the
file's numbers to exact ones makes (length scale 1 m).
*Certificate*: its size.
*Time*: processor time, the least of {rounds}, from the geometry to the words.
*Proof*, *check*: finding the certificate, once, and checking it with `checker.py`; processor time.

{table}

"""


def passed_through(robot: str) -> Counter[str]:
    """Named functions of pinsing that one closed form of a loaded robot calls, by module."""
    closed_form(load("stanford"))  # what is done once a process is not the robot's
    arm, package, met = load(robot), str(Path(pinsing.__file__).parent), set[CodeType]()

    def meet(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            met.add(frame.f_code)

    sys.setprofile(meet)
    closed_form(arm)
    sys.setprofile(None)
    named = [c for c in met if c.co_filename.startswith(package) and c.co_name[0] != "<"]
    return Counter(str(Path(c.co_filename).relative_to(package)) for c in named)


def compare(old: str, new: str) -> list[str]:
    """Lines of the table that differ, times aside."""

    def rows(text: str) -> list[str]:
        lines = [line for line in text.splitlines() if line.startswith("| ")]
        return ["|".join(cell.strip() for cell in line.split("|")[: -1 - TIMES]) for line in lines]

    a, b = rows(old), rows(new)
    return [x for x in b if x not in a] + [f"gone: {x}" for x in a if x not in b]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("arms", nargs="*", metavar="ARM", help="part of a name; default all")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--sympy-limit", type=float, default=20.0, metavar="SECONDS")
    parser.add_argument("--no-sympy", action="store_true")
    parser.add_argument("--write", type=Path, metavar="FILE")
    parser.add_argument("--check", type=Path, metavar="FILE")
    parser.add_argument("--functions", metavar="ROBOT")
    options = parser.parse_args()
    if options.functions:
        found = passed_through(options.functions)
        print(*(f"{count:4} {module}" for module, count in sorted(found.items())), sep="\n")
        print(f"{found.total()} functions in {len(found)} modules")
        return
    chosen = {
        name: spec
        for name, spec in ARMS.items()
        if not options.arms or any(a.lower() in name.lower() for a in options.arms)
    }
    if not chosen:
        parser.error(f"no arm of that name; there are {', '.join(ARMS)}")
    page = options.write or options.check
    if not page and not options.no_sympy and importlib.util.find_spec("sympy") is None:
        parser.error("Sympy is not installed: run scripts/setup dev, or give --no-sympy")
    rounds = 1 if options.check else options.rounds
    rows = []
    for name, spec in chosen.items():
        arm = load(**spec)
        form, times = timed(arm, rounds)
        row = families_row(name, arm, form, times)
        if not page and not options.no_sympy:
            row += [limited(t, spec, options.sympy_limit) for t in (trigonometric, polynomial)]
        rows.append(row)
        print(
            f"{name}: {len(form.families)} families, {1000 * times.answer:.0f} ms, {form.word}",
            file=sys.stderr,
        )
    head = HEAD if page or options.no_sympy else [*HEAD, "Sympy, trig.", "Sympy, poly."]
    text = table(rows, head)
    if options.check:
        different = compare(options.check.read_text(encoding="utf-8"), text)
        if different:
            sys.exit(f"{options.check} is out of date:\n" + "\n".join(different))
    elif options.write:
        options.write.parent.mkdir(parents=True, exist_ok=True)
        options.write.write_text(
            PAGE.format(table=text, rounds=rounds).rstrip() + "\n", encoding="utf-8"
        )
    else:
        print(f"Python {platform.python_version()}, {platform.machine()}, {platform.processor()}")
        print(text)


if __name__ == "__main__":
    main()
