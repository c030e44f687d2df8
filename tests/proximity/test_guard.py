"""Exported guards: compiled and compared with pinsing, never clear where they must not be."""

import ctypes
import functools
import importlib.util
import re
import shutil
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from command_line import run
from singular_sets import ROBOTS, arm_of, closed, sliding_equation
from tiers import tiered, tiered_rows

import pinsing
from pinsing.algebra.conditions import two_sided
from pinsing.errors import OptionError, PinsingError, UnknownNameError
from pinsing.families import Branch, ClosedForm
from pinsing.measures import Array
from pinsing.proximity import monitor as guard_module
from pinsing.proximity.clearance import watch
from pinsing.proximity.monitor import make_guard
from pinsing.robot.arm import Arm

DRIVER = Path(__file__).parent / "guard_driver.c"
WARNINGS = [
    "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wconversion", "-Wdouble-promotion", "-Wshadow",
    "-Wcast-qual", "-Wundef", "-Wvla", "-Wcomment", "-Wtrigraphs",
]  # fmt: skip
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")


def pointers(*arrays: Array) -> list[Any]:
    return [a.ctypes.data_as(ctypes.c_void_p) for a in arrays]


@dataclass
class CGuard:
    """A header in a shared library."""

    library: Any
    n: int
    families: int
    equations: int

    def ask(self, Q: Array) -> tuple[Array, Array, Array]:
        """Clearance (N,), family (N,), and (N, F, 2 + n): f, lower, gradient of each family."""
        Q = np.ascontiguousarray(Q, dtype=float)
        lower, number = np.empty(len(Q)), np.empty(len(Q), dtype=np.int32)
        each = np.empty((len(Q), self.families, 2 + self.n))
        self.library.ask(len(Q), *pointers(Q, lower, number, each))
        return lower, number, each

    def values(self, Q: Array) -> Array:
        """Values and gradients (N, E, 1 + n) of all equations."""
        Q = np.ascontiguousarray(Q, dtype=float)
        out = np.empty((len(Q), self.equations, 1 + self.n))
        self.library.equations(len(Q), *pointers(Q, out))
        return out

    def clear(self, q: Array, radius: float) -> bool:
        return bool(self.library.clear(*pointers(np.array(q, float)), ctypes.c_double(radius)))

    def inside(self, q: Array) -> bool:
        return bool(self.library.inside(*pointers(np.array(q, float))))

    def text(self, function: str, i: int) -> bytes:
        call = getattr(self.library, function)
        call.restype = ctypes.c_char_p
        return bytes(call(i))


def compiled(header: str, folder: Path, *flags: str, compiler: str = "gcc") -> CGuard:
    (folder / "guard.h").write_text(header, encoding="ascii")
    prefix = re.search(r"^#ifndef (\w+)_GUARD_H$", header, re.MULTILINE)[1]
    library = folder / "guard.so"
    language = ["-std=c99"] if compiler == "gcc" else ["-std=c++11", "-x", "c++"]
    names = "JOINTS", "FAMILIES", "EQUATIONS"
    counts = [re.search(rf"^#define {prefix}_{x} (\d+)$", header, re.MULTILINE)[1] for x in names]
    done = subprocess.run(
        [
            compiler, *language, *WARNINGS, *(flags or ("-O2",)), "-shared", "-fPIC",
            f'-DGUARD_HEADER="{folder}/guard.h"', f"-DPREFIX={prefix.lower()}",
            *(f"-D{name}_={count}" for name, count in zip(names, counts, strict=True)),
            *["-DZONED"] * ("_in_zones(" in header),
            "-o", str(library), str(DRIVER), "-lm",
        ],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return CGuard(ctypes.CDLL(str(library)), *map(int, counts))


@dataclass
class PythonGuard:
    """A module, asked as a header is."""

    module: ModuleType

    def ask(self, Q: Array) -> tuple[Array, Array, Array]:
        found = [self.module.family(i, Q) for i in range(len(self.module.TEXTS))]
        each = [np.column_stack([f, low, gradient]) for f, gradient, low in found]
        return self.module.clearance(Q), self.module.nearest(Q), np.stack(each, axis=1)

    def values(self, Q: Array) -> Array:
        out = np.empty((len(Q), len(self.module._SUMS), 1 + Q.shape[1]))
        for i in range(out.shape[1]):
            out[:, i, 0], out[:, i, 1:] = self.module.equation(i, Q)
        return out

    def inside(self, q: Array) -> bool:
        return bool(self.module.within_limits(q))


def module(text: str, folder: Path) -> ModuleType:
    path = folder / "guard.py"
    path.write_text(text, encoding="ascii")
    spec = importlib.util.spec_from_file_location("exported_guard", path)
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


def both(folder: Path, arm: Arm, **how: Any) -> tuple[CGuard, ModuleType]:
    """The guards of two languages."""
    c, python = (make_guard(arm, language, **how).text for language in ("c", "python"))
    return compiled(c, folder, "-O0"), module(python, folder)


def configurations(form: ClosedForm, count: int, seed: int = 0) -> Array:
    """Random ones, ones near families, ones on them, ones far away and at limits."""
    rng = np.random.default_rng(seed)
    n = form.arm.n
    on = [f.points(max(2, count // (4 * max(1, len(form.families)))), rng) for f in form.families]
    on_them = np.concatenate([np.zeros((0, n)), *on])
    near = np.repeat(on_them, 2, axis=0)
    near += rng.normal(size=near.shape) * 10.0 ** rng.uniform(-12, -1, (len(near), 1))
    far = rng.uniform(-300, 300, (count // 20, n))
    limits = np.where(np.isfinite(form.arm.lower), form.arm.lower, 0.0)[None]
    rest = max(count - len(on_them) - len(near) - len(far) - 1, 0)
    return np.concatenate([on_them, near, far, limits, rng.uniform(-4, 4, (rest, n))])


def case(name: str) -> tuple[Arm, ClosedForm]:
    """A robot; or d3^2 + 0.5 d3 cos q2 - 0.3 = 0 and q5 = 0.2, and d3 = 0.1 or both, in an arm."""
    if name != "slides":
        arm = pinsing.load(**ROBOTS[name], units="rad")
        return arm, pinsing.closed_form(arm, prove=False)
    arm = pinsing.load("stanford", units="rad", length_scale=0.4)
    form = pinsing.closed_form(arm, prove=False)
    equation = sliding_equation(form)
    single = replace(form.families[0], branches=(Branch((), (equation,)),))
    wrist = form.families[2].branches[0].values
    both = replace(form.families[0], name="F4", branches=(Branch(wrist, (equation,)),))
    return arm, replace(form, families=(single, *form.families[1:], both))


HEADERS = [
    *((name, "gcc") for name in ("ur5", "slides")), ("z1", "gcc -O0"),
    *((name, "gcc") for name in ("puma560", "stanford", "panda", "surgical7", "scara", "baxter")),
    ("z1", "gcc -O3 -march=native"), ("z1", "gcc -Os -ffp-contract=off"), ("slides", "g++"),
]  # fmt: skip
MODULES = "ur5", "stanford", "slides", "puma560", "panda", "surgical7", "baxter"
GUARDS = [*HEADERS, *((name, "python") for name in MODULES)]


@pytest.mark.parametrize(
    ("name", "compiler"), tiered_rows(GUARDS, [*HEADERS[1:3], *GUARDS[len(HEADERS) :][:3]])
)
def test_a_guard_says_what_pinsing_says(name: str, compiler: str, tmp_path: Path) -> None:
    """Never above, and the same but for rounding."""
    arm, form = case(name)
    compiler, *flags = compiler.split()
    if compiler == "python":
        found = PythonGuard(module(pinsing.export_guard(arm, "python", forms=form), tmp_path))
    elif shutil.which(compiler):
        header = pinsing.export_guard(arm, "c", forms=form)
        found = compiled(header, tmp_path, *flags, compiler=compiler)
    else:
        pytest.skip("no C compiler")
    Q = configurations(form, 3000 if compiler != "python" or name == "ur5" else 1500)
    lower, number, each = found.ask(Q)
    watched = watch(form, real=False)
    reference = two_sided(watched.conditions, Q, each=True)
    # Several equations are combined with multiples that near a family depend on rounding.
    several = any(len(b.equations) > 1 for f in watched.families for b in f.branches)
    close = {"rtol": 1e-7, "atol": 1e-8 if several else 1e-12}
    np.testing.assert_allclose(lower, reference.lower, **close)
    np.testing.assert_allclose(each[..., 1], reference.each[..., 0], **close)
    assert (lower == each[..., 1].min(axis=1)).all()
    assert (number == each[..., 1].argmin(axis=1)).all()
    # Nothing is clear within an upper bound, and nothing on a family is clear at all.
    assert (each[..., 1] <= reference.each[..., 1]).all()
    some = Q[:: max(1, len(Q) // 60)]
    for q in (*some, *arm.span):
        assert found.inside(q) is bool(((q >= arm.lower) & (q <= arm.upper)).all())
    if isinstance(found, CGuard):
        true = pinsing.clearance(form, some, families=watched.names, certify=True, gap=1e-4)
        assert (found.ask(some)[0] <= true.upper).all()
    equations = [e for f in watched.families for e in f.equations]
    values = found.values(Q)
    assert len(equations) == values.shape[1]
    for i, e in enumerate(equations):
        size = e.size * max(1.0, float(np.abs(Q[:, list(e.involved)]).max()) ** int(e.powers.max()))
        np.testing.assert_allclose(values[:, i, 0], e(Q), atol=1e-12 * size)
        np.testing.assert_allclose(values[:, i, 1:], e.gradient(Q), atol=1e-11 * size)
    f, slope = each[..., 0], each[..., 2:]
    step = 1e-6 * np.random.default_rng(1).normal(size=Q.shape)
    after = found.ask(Q + step)[2][..., 0]
    smooth = (np.abs(f) > 1e-3) & (each[..., 1] < 0.3)  # half a turn off, another value is nearer
    change = np.einsum("nfj,nj->nf", slope, step)
    off = np.abs(after - f - change)[smooth]
    if off.size:  # another branch may be nearer after the step
        assert np.quantile(off, 0.99) < 1e-8


@needs_gcc
def test_fast_math_is_refused(tmp_path: Path) -> None:
    (tmp_path / "g.h").write_text(pinsing.export_guard(arm_of("scara"), forms=closed("scara")))
    (tmp_path / "g.c").write_text('#include "g.h"\nint main(void) { return 0; }\n')
    words = ["gcc", "-std=c99", "-ffast-math", "g.c", "-o", "g"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert "not true under -ffast-math" in done.stderr


@needs_gcc
def test_shapes_and_values_that_are_not_finite_are_never_clear(tmp_path: Path) -> None:
    c, python = both(tmp_path, arm_of("ur5"), forms=closed("ur5"))
    good = np.array([0, -1.2, 1.3, -1, -1.4, 0])
    assert python.clearance(good).shape == ()
    assert python.clearance(np.tile(good, (2, 3, 1))).shape == (2, 3)
    assert arm_of("ur5").joints == python.JOINTS
    assert pinsing.__version__ == python.VERSION
    with pytest.raises(ValueError, match="values, got shape"):
        python.clearance([0.0])
    with pytest.raises(IndexError):
        python.family(99, good)
    assert c.clear(good, 0.05)
    assert python.is_clear(good, 0.05)
    for value in (np.nan, np.inf, -np.inf, 1e300, -1e308):
        for joint in range(1, 5):
            q = good.copy()
            q[joint] = value
            assert not c.clear(q, 0.0)
            assert not python.is_clear(q, 0.0)
    nothing = np.full((1, 6), np.nan)
    for lower, number, each in (c.ask(nothing), PythonGuard(python).ask(nothing)):
        assert (lower[0], number[0]) == (0, -1)
        assert not each[..., 1].any()
    assert not c.clear(good, np.nan)


HOSTILE = [
    'a*/ int x; /*"', "tab\tline\nbreak", "ключ", "q\\", 'quote"quote', "??/ trigraph ??)", "",
    "@families@", "%s{x}", "null\0byte", "\ud800", "/*", "//", "\u2028end", "'''\"\"\"", "*\\\n/",
]  # fmt: skip


@needs_gcc
@pytest.mark.parametrize("name", tiered(HOSTILE, HOSTILE[:1] + HOSTILE[9:11]), ids=ascii)
def test_names_that_want_to_be_code(name: str, tmp_path: Path) -> None:
    arm = replace(arm_of("planar3r"), units="rad")
    form = closed("planar3r")
    joints = (name, f"x{name}", f"{name}{name}")
    source = replace(arm.source, label=name)
    odd = replace(arm, name=name, joints=joints, source=source, tip=arm.tip)
    form = replace(form, arm=replace(form.arm, name=name, joints=joints))
    form = replace(form, families=(replace(form.families[0], text=name),))
    c, python = both(tmp_path, odd, forms=form)
    assert c.text("joint_name", 1) == f"x{name}".encode("utf-8", "backslashreplace").split(b"\0")[0]
    assert c.text("family_text", 0) == name.encode("utf-8", "backslashreplace").split(b"\0")[0]
    assert joints == python.JOINTS
    assert (name,) == python.TEXTS
    Q = configurations(form, 200)
    np.testing.assert_allclose(c.ask(Q)[0], python.clearance(Q), rtol=1e-9, atol=1e-12)


@needs_gcc
def test_where_families_are_missing_nothing_is_clear(tmp_path: Path) -> None:
    arm = arm_of("panda")
    poor = pinsing.closed_form(arm, seconds=0.02)
    assert not poor.complete
    whole = closed("panda")
    for form, families in ((poor, None), (whole, ["F1"])):
        made = make_guard(arm, "c", forms=form, families=families)
        assert not made.complete
        assert made.notes
        c, python = both(tmp_path, arm, forms=form, families=families)
        rng = np.random.default_rng(0)
        for q in rng.uniform(-2, 2, (20, 7)):
            assert not c.clear(q, 0.0)
            assert not python.is_clear(q, 0.0)
            assert python.clearance(q) == 0.0
        assert python.known_clearance(np.full(7, 1.0)) > 0
        assert "#define PANDA_COMPLETE 0" in made.text
        assert '#define PANDA_WORD "not complete"' in made.text
        assert made.word == python.WORD == "not complete"
        for note in made.notes:
            assert note.split()[0] in made.text


@functools.cache
def of_positions() -> pinsing.ClosedForm:
    return pinsing.closed_form(arm_of("ur5").with_task("position"), prove=False)


def test_what_a_guard_promises(monkeypatch: pytest.MonkeyPatch) -> None:
    form = closed("stanford")
    form = replace(form, families=(*form.families[:2], replace(form.families[2], real=False)))
    assert "#define STANFORD_FAMILIES 3" in pinsing.export_guard(arm_of("stanford"), forms=form)
    for language in ("c", "python"):
        text = make_guard(arm_of("ur5"), language, forms=closed("ur5")).text
        assert "proven distance to the nearest singular configuration" not in text.lower()
        assert "proven distance to the nearest of the families listed" in text
    arm = arm_of("ur5")
    proven = pinsing.closed_form(arm)
    assert make_guard(arm, "c", forms=proven).word == "proven"
    made = make_guard(arm, "c", forms=[proven, of_positions()])
    assert made.word == "probable"
    assert made.complete
    assert any("no certificate was looked for" in note for note in made.notes)
    pointing = pinsing.closed_form(arm.with_task("tool-axis"), prove=False)
    assert "task tool-axis." in pinsing.export_guard(arm, forms=pointing)
    monkeypatch.setattr(guard_module, "MOST_TERMS", 2)
    made = make_guard(arm, "c", forms=proven)
    assert not made.complete
    assert any("F3 is left out: its equations have 3 terms" in note for note in made.notes)
    assert "#define UR5_FAMILIES 2" in made.text


def test_forms_of_two_tasks_and_of_another_arm() -> None:
    arm = arm_of("ur5")
    both = [closed("ur5"), of_positions()]
    text = pinsing.export_guard(arm, "python", forms=both)
    assert "'pose F1'" in text
    assert "'position F1'" in text
    mechanism = pinsing.load_mechanism("urdf/five_bar.urdf")
    for given, options, error, said in (
        (arm, {"forms": closed("ur10")}, OptionError, "another arm"),
        (arm, {"forms": closed("ur5"), "families": ["F9"]}, UnknownNameError, "F9"),
        (arm, {"forms": closed("ur5"), "language": "rust"}, PinsingError, "language"),
        (mechanism, {}, OptionError, "arm must be"),
    ):
        with pytest.raises(error, match=said):
            pinsing.export_guard(given, **options)


def test_how_sure_it_is_stands_in_the_files_and_on_stderr(tmp_path: Path) -> None:
    h, py = tmp_path / "guard.h", tmp_path / "guard.py"
    words = "export", "ur5", "-o", h, "-o", py
    done = run(*words, "--no-prove")
    assert done.exit_code == 0
    assert "is probable, not proven: no certificate was looked for" in done.stderr
    assert "--prove looks for a certificate" in done.stderr
    for said in ('#define UR5_WORD "probable"', "is probable, not proven"):
        assert said in h.read_text()
    guard = module(py.read_text(), tmp_path)
    assert (guard.WORD, guard.COMPLETE) == ("probable", True)
    assert any("probable" in note for note in guard.NOTES)
    done = run(*words, "--prove")
    assert done.exit_code == 0
    assert "probable" not in done.stderr
    assert f"wrote {h}" in done.stderr
    proven = pinsing.closed_form(arm_of("ur5"))
    assert h.read_text() == pinsing.export_guard(arm_of("ur5"), forms=proven)
    assert '#define UR5_WORD "proven"' in h.read_text()
    assert module(py.read_text(), tmp_path).WORD == "proven"
    done = run("export", "panda", "--seconds", "0.02", "-o", h)
    assert done.exit_code == 0
    assert "not complete" in done.stderr
    assert "nothing is ever clear" in done.stderr


EXAMPLES = Path(__file__).parents[2] / "examples"


@needs_gcc
@pytest.mark.skipif(shutil.which("make") is None, reason="no make")
def test_the_example_in_c(tmp_path: Path) -> None:
    folder = tmp_path / "guard_c"
    shutil.copytree(EXAMPLES / "guard_c", folder)
    (folder / "ur5_guard.h").write_text(pinsing.export_guard(arm_of("ur5"), forms=closed("ur5")))
    words = ["make", f"CFLAGS=-std=c99 -O2 {' '.join(WARNINGS)}", "loop"]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    done = subprocess.run(["./loop"], cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert "q5 = 0\u00b0 or 180\u00b0, slowing down" in done.stdout
    nearest = re.search(r"nearest ([\d.]+) rad, q5 = ([\d.]+)", done.stdout)
    assert 0.05 <= float(nearest[1]) < 0.1
    assert float(nearest[2]) > 0.05


@needs_gcc
@pytest.mark.usefixtures("undrawn")
def test_guards_and_a_report_say_what_a_monitor_says(tmp_path):
    form = pinsing.closed_form(pinsing.load("scara"))
    words = "--joint-speeds 5,5,1,10 --within q3=0..0.1,q1=1..3 -o"
    done = run("zones", "scara", *words.split(), tmp_path / "zones.json")
    assert done.exit_code == 0, done.output
    found = pinsing.proximity.Zones.from_json((tmp_path / "zones.json").read_text())
    files = [word for end in ("h", "py") for word in ("-o", str(tmp_path / f"guard.{end}"))]
    done = run("export", "scara", "--zones", tmp_path / "zones.json", *files)
    assert done.exit_code == 0, done.output
    python = module((tmp_path / "guard.py").read_text(), tmp_path)
    assert (python.TIP_SPEED, python.TURN_SPEED) == (0.25, 0.5)
    monitor = pinsing.Monitor(form, zones=found)
    Q = np.random.default_rng(4).uniform([-4, -4, -0.02, -6], [4, 4, 0.12, 6], (400, 4))
    said = np.array([monitor.update(q).zones != () for q in Q])
    assert 50 < said.sum() < 395
    np.testing.assert_array_equal(python.in_zones(Q), said)
    assert python.in_zones([np.nan, 1, 0, 0])
    nowhere = np.vstack([Q, [0, np.nan, 0, 0]])
    found_in = np.empty(len(nowhere), dtype=np.int32)
    c = compiled((tmp_path / "guard.h").read_text(), tmp_path)
    c.library.in_zones(len(nowhere), *pointers(nowhere, found_in))
    np.testing.assert_array_equal(found_in, [*said, True])
    with pytest.raises(OptionError, match="zones are of scara"):
        pinsing.export_guard(pinsing.load("planar3r"), zones=found)
    page = tmp_path / "report.html"
    pinsing.write_report(form.loaded, page, forms=form, zones=found, page="none")
    html = page.read_text()
    assert "How near is too near" in html
    assert "keep 20.3\N{DEGREE SIGN} from F1" in html
    bad = run("report", "scara", "--zones", tmp_path / "guard.py", "-o", tmp_path / "r.html")
    assert bad.exit_code == 2
    assert "not JSON" in bad.stderr
    loops = Path(__file__).parents[2] / "urdf" / "five_bar.urdf", "--loops"
    bad = run("view", *loops, "--zones", tmp_path / "zones.json", "-o", tmp_path / "r.html")
    assert "--zones does not go with --loops" in bad.stderr
