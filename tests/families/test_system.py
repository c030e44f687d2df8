"""Families as files of exact equations: what they say is what the families say."""

import functools
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from arms import planar
from command_line import run
from dh_arms import HOLLOW, dh_arm, form_of
from singular_sets import finger
from tiers import tiered
from urdf_text import Z, chain_text, follows

import pinsing


@pytest.fixture(autouse=True, scope="module")
def _sympy():
    """Most of a second, for these tests alone."""
    global sympy
    import sympy


# What comments begin with, and where names of variables and ideals stand.
FORMATS = {
    "singular": ("//", r"ring R = 0,\(([^)]*)\),dp;", r"ideal (\w+) =([^;]*);"),
    "maple": ("#", r"vars := \[([^]]*)\]:", r"(F\w+) := \[([^]]*)\]:"),
    "sage": ("#", r'\[("[^]]*)\]', r"(F\w+) = R.ideal\(\[([^]]*)\]\)"),
}


def read(text, language):
    """Names of variables, and the polynomials of each system by its name."""
    if language == "msolve":
        names, zero, rest = text.split("\n", 2)
        assert zero == "0"
        assert not set("()#") & set(rest)
        return names.split(","), {"": [polynomial(p) for p in rest.split(",")]}
    mark, names, ideals = FORMATS[language]
    plain = "\n".join(line for line in text.splitlines() if not line.startswith(mark))
    names = re.findall(r"\w+", re.search(names, plain)[1])
    found = re.findall(ideals, plain)
    return names, {name: [polynomial(p) for p in body.split(",")] for name, body in found}


def polynomial(text):
    return sympy.sympify(text.strip().replace("^", "**"))


def meaning(form, text):
    """What each variable is at q, from the comments of a file."""
    (line,) = re.findall(r"// variables: (.*)", text)
    pieces = re.findall(r"(\w+) = (cos|sin|sqrt)\(([^)]*)\)|(d\d+) = d\d+, metres", line)
    joint = {s: i for i, s in enumerate(form.symbols)}

    def value(name, function, inner, slide, q):
        if slide:
            return slide, q[joint[slide]]
        if function == "sqrt":
            return name, float(inner) ** 0.5
        symbol, *turn = inner.split(" ")
        angle = q[joint[symbol]] + (float("".join(turn)) if turn else 0.0)
        return name, getattr(np, function)(angle)

    return lambda q: dict(value(*piece, q) for piece in pieces)


def largest(polys, names, at):
    """The largest polynomial at a point, each over the sum of its terms' sizes."""
    values = [at[name] for name in names]
    sizes = [abs(v) for v in values]
    out = []
    for p in polys:
        numbers, powers = terms(p, tuple(names))
        total = np.abs(numbers) @ np.prod(np.power(sizes, powers), axis=1)
        real = numbers @ np.prod(np.power(values, powers), axis=1)
        out.append(abs(real) / max(total, 1.0))
    return max(out)


@functools.cache
def terms(poly, names):
    """Coefficients (T,) and exponents (T, variables)."""
    found = sympy.Poly(poly, *sympy.symbols(names)).terms()
    return np.array([float(c) for _, c in found]), np.array([m for m, _ in found])


def systems_of(systems, family):
    return [p for name, p in systems.items() if re.fullmatch(rf"{family.name}(_\d+)?", name)]


def agree(form, count=8):
    """Systems vanish on the families, not elsewhere, and vanish together nowhere else."""
    text = form.system()
    names, systems = read(text, "singular")
    at = meaning(form, text)
    rng = np.random.default_rng(7)
    for family in form.families:
        own = systems_of(systems, family)
        points = family.points(count, rng)
        assert len(points)
        for q in points:
            assert min(largest(p, names, at(q)) for p in own) < 1e-13, family
        for q in rng.uniform(-3, 3, (count, len(form.symbols))):
            assert min(largest(p, names, at(q)) for p in own) > 1e-8, family
    assert sum(len(systems_of(systems, f)) for f in form.families) == len(systems)
    return names, systems, at


def solved(form, polys, names, at, rng):
    """A configuration where polynomials vanish, by least squares from a random one."""
    from scipy.optimize import least_squares

    symbols = sympy.symbols(names)
    sizes = [max(abs(c) for c in sympy.Poly(p).coeffs()) for p in polys]
    f = sympy.lambdify([symbols], [p / k for p, k in zip(polys, sizes, strict=True)], "numpy")

    def residual(q):
        values = at(q)
        return np.array(f([values[n] for n in names]), dtype=float)

    for _ in range(30):
        start = rng.uniform(-2, 2, len(form.symbols))
        found = least_squares(residual, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        if np.abs(found.fun).max() < 1e-9:
            return found.x
    return None


@pytest.mark.slow
@pytest.mark.parametrize("name", tiered(["ur5", "stanford", "panda"], ("stanford", "panda")))
def test_equations_vanish_on_the_families_and_nowhere_else(name):
    form = form_of(name)
    names, systems, at = agree(form)
    rng = np.random.default_rng(5)
    for family in form.families:
        for polys in systems_of(systems, family):
            q = solved(form, polys, names, at, rng)
            assert q is not None, family
            assert family.contains(q, tol=1e-4), (family, q)


@pytest.mark.parametrize("language", ["singular", "maple", "sage"])
def test_all_languages_say_the_same(language):
    form = form_of("panda")
    assert read(form.system(language), language) == read(form.system(), "singular")


@pytest.mark.slow
def test_several_systems_for_msolve_are_told_apart_by_a_number():
    form = form_of("panda")
    names, systems = read(form.system(families=["F4"]), "singular")
    assert read(form.system("msolve", families=["F4"]), "msolve") == (names, {"": systems["F4"]})
    names, systems = read(form.system(), "singular")
    more, told = read(form.system("msolve"), "msolve")
    assert more == ["k", *names]
    k = sympy.Symbol("k")
    circles = set(systems["F1"]) & set(systems["F2"]) & set(systems["F4"])
    assert len(circles) == 5
    for number, polys in enumerate(systems.values(), 1):
        left = {sympy.expand(p.subs(k, number)) for p in told[""]} - {0}
        monic = {sympy.Poly(p).monic() for p in left}
        assert monic == {sympy.Poly(p).monic() for p in polys}
    (which,) = [p for p in told[""] if p.free_symbols == {k}]
    assert sorted(sympy.solve(which, k)) == list(range(1, len(systems) + 1))


def test_joints_turned_about_their_axes_are_said_to_be():
    rows = (0, 0, 0), (0.3, 0.5, 0.1), (np.pi / 2, 0.4, 0.2), (0.2, 0.3, 0.3)
    joints = [("revolute", (x, y, 0), Z, (0, 0, turn)) for turn, x, y in rows]
    arm = pinsing.load(chain_text([*joints, ("fixed", (0.2, 0, 0))]), task="vx,vy,wz")
    form = pinsing.closed_form(arm)
    agree(form)
    assert re.search(r"cos\(q\d [+-] 0\.\d+\)", form.system())


def test_half_angles_followers_and_square_roots():
    form = pinsing.closed_form(planar((0.5, 0.4, 0.3)))
    agree(form)
    (family,) = form.families
    assert read(form.system(), "singular")[1]["F1"][:2] == list(sympy.symbols("s2 s3"))
    assert family.codimension == 2
    form = pinsing.closed_form(finger(mimic=follows(2, 2, 0.3)).with_task("vx,vy"))
    assert form.families
    agree(form)
    form = pinsing.closed_form(dh_arm(HOLLOW))
    names, systems, _ = agree(form, count=3)
    assert "r3" in names
    assert "meant are solutions with r3 > 0 alone" in form.system()
    assert all(any(str(p) == "r3**2 - 3" for p in polys) for polys in systems.values())


def test_names_with_line_breaks_stay_within_their_comment():
    form = form_of("stanford")
    odd = replace(form, arm=replace(form.arm, name="a\nideal F1 = 1;", tip="t\rquit;"))
    assert read(odd.system(), "singular") == read(form.system(), "singular")


def test_the_command_writes_what_the_library_says(tmp_path):
    def wrote(file, *more):
        words = ["families", "stanford", "--no-prove", "-o", str(tmp_path / file), *more]
        done = run(*words)
        assert done.exit_code == 0
        return done, (tmp_path / file).read_text()

    done, text = wrote("stanford.sing", "--family", "F2")
    assert "q5 = 0° or 180°" in done.stdout
    assert f"wrote {tmp_path / 'stanford.sing'}" in done.stderr
    assert read(text, "singular") == read(form_of("stanford").system(families=["F2"]), "singular")
    assert "robot stanford, base base_link, tip tool0, task pose" in text
    done, text = wrote("stanford.ms")  # what has no place in the file
    assert "1 = F1, 2 = F2, 3 = F3" in done.stderr
    assert text.startswith("k,c2,s2,d3,c5,s5\n0\n")


# Singular, a program that we have no part in, is asked for the dimension of each family.
PROGRAM = shutil.which("Singular")
needs_singular = pytest.mark.skipif(PROGRAM is None, reason="Singular is not installed")


def asked(text, *more):
    """What Singular prints after it has read a file and some commands, line by line."""
    run = subprocess.run(
        [PROGRAM, "-q", "--no-rc"],
        input="\n".join([text, *more, "quit;", ""]),
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    lines = [line for line in run.stdout.splitlines() if line and not line.startswith("// **")]
    assert not [line for line in lines if "?" in line], lines  # so it begins its errors
    return lines


def ideals(text):
    return re.findall(r"^ideal (\w+) =", text, re.M)


ASKED = ["ur5", "puma560", "stanford", "iiwa14", "panda", "surgical7", "with square roots"]


@needs_singular
@pytest.mark.parametrize("name", ASKED)
def test_dimensions(name):
    form = form_of(name) if name in ASKED[:-1] else pinsing.closed_form(dh_arm(HOLLOW))
    text = form.system()
    told = asked(text, *(f"dim(std({k}));" for k in ideals(text)))
    joints = sum(name[0] in "cd" for name in read(text, "singular")[0])
    for family in form.families:
        own = [int(d) for k, d in zip(ideals(text), told, strict=True) if k.startswith(family.name)]
        assert max(own) == joints - family.codimension
