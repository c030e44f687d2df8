"""Files of equations read by Singular, a program that we have no part in, where it is installed.

It is asked what we claim: the dimension of each family, and that the determinant of the Jacobian,
which it multiplies out itself from the placements of the joints, vanishes on the families and
nowhere else. The grammar of the files, and where their equations vanish, is tested without it in
``test_system``.
"""

import re
import shutil
import subprocess

import numpy as np
import pytest
from test_closed_form_twists import HOLLOW, arm_of

import pinsing
from pinsing.robot.nominal import nominal

PROGRAM = shutil.which("Singular")
pytestmark = pytest.mark.skipif(PROGRAM is None, reason="Singular is not installed")
ARMS = ("ur5", "puma560", "stanford", "iiwa14", "panda", "surgical7")


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


@pytest.fixture(scope="module")
def forms():
    return {name: pinsing.closed_form(pinsing.load(name)) for name in ARMS}


def ideals(text):
    return re.findall(r"^ideal (\w+) =", text, re.M)


def names_of(text):
    return re.search(r"^ring R = 0,\(([^)]*)\),dp;", text, re.M)[1].split(",")


@pytest.mark.parametrize("name", ARMS)
def test_dimensions(forms, name):
    form = forms[name]
    text = form.system()
    told = asked(text, *(f"dim(std({k}));" for k in ideals(text)))
    joints = sum(not n.startswith(("s", "r")) for n in names_of(text))
    for family in form.families:
        own = [int(d) for k, d in zip(ideals(text), told, strict=True) if k.startswith(family.name)]
        assert max(own) == joints - family.codimension


def test_square_roots_are_numbers():
    form = pinsing.closed_form(arm_of(HOLLOW))
    text = form.system()
    assert "r3" in names_of(text)
    told = asked(text, *(f"dim(std({k}));" for k in ideals(text)))
    joints = sum(n[0] in "cd" for n in names_of(text))
    assert [int(d) for d in told] == [joints - f.codimension for f in form.families]


MULTIPLIED = """
proc inv(matrix T) {
  matrix V[4][4]; int a; int b; V[4,4] = 1;
  for (a=1; a<=3; a++) {
    for (b=1; b<=3; b++) { V[a,b] = T[b,a]; V[a,4] = V[a,4] - T[b,a]*T[b,4]; }
  }
  return(V); }
proc low(matrix T, ideal K) {
  matrix V = matrix(reduce(ideal(T),K),nrows(T),ncols(T)); return(V); }
"""


def determinant_in_singular(arm):
    """Commands that leave the determinant of the Jacobian in ``D``, from placements and motions."""
    exact = nominal(arm)
    quarter = np.round(exact.offset / (np.pi / 2)).astype(int)
    assert np.abs(exact.offset - quarter * np.pi / 2).max() < 1e-12
    variables, circles, out = [], [], []
    for j, slides in enumerate(exact.prismatic, 1):
        variables += [f"d{j}"] if slides else [f"c{j}", f"s{j}"]
        circles += [] if slides else [f"c{j}^2+s{j}^2-1"]
    out.append(f"ring J = 0,({','.join(variables)}),dp;")
    out.append(MULTIPLIED)
    out.append(f"ideal K = std(ideal({','.join(circles)}));")

    def placed(i):
        rows = [[*map(str, exact.rotation[i][r]), str(exact.translation[i][r])] for r in range(3)]
        return ",".join(x for row in [*rows, ["0", "0", "0", "1"]] for x in row)

    def moved(j):
        if exact.prismatic[j - 1]:
            return f"1,0,0,0,0,1,0,0,0,0,1,d{j},0,0,0,1"
        c, s = [
            (f"c{j}", f"s{j}"), (f"-s{j}", f"c{j}"), (f"-c{j}", f"-s{j}"), (f"s{j}", f"-c{j}")
        ][quarter[j - 1] % 4]  # fmt: skip
        return f"{c},-({s}),0,0,{s},{c},0,0,0,0,1,0,0,0,0,1"

    n, middle = arm.n, arm.n // 2
    for j in range(1, n + 1):
        out += [f"matrix P{j}[4][4] = {placed(j - 1)};", f"matrix M{j}[4][4] = {moved(j)};"]
    out.append(f"matrix T{middle} = freemodule(4);")
    for j in range(middle, n):
        out.append(f"matrix T{j + 1} = low(T{j}*M{j}*P{j + 1},K);")
    for j in range(middle - 1, 0, -1):
        out.append(f"matrix T{j} = low(T{j + 1}*inv(low(M{j}*P{j + 1},K)),K);")
    out.append(f"matrix A[6][{n}];")
    for j, slides in enumerate(exact.prismatic, 1):
        z = [f"T{j}[{r},3]" for r in (1, 2, 3)]
        p = [f"T{j}[{r},4]" for r in (1, 2, 3)]
        v = z if slides else [f"{p[a]}*{z[b]}-{p[b]}*{z[a]}" for a, b in ((1, 2), (2, 0), (0, 1))]
        w = ["0"] * 3 if slides else z
        out += [f"A[{r},{j}] = {x};" for r, x in enumerate([*v, *w], 1)]
    out.append("A = low(A,K); poly D = reduce(det(A),K);")
    return out


@pytest.mark.parametrize("name", ["ur5", "puma560", "stanford"])
def test_the_determinant_vanishes_on_the_families_and_nowhere_else(forms, name):
    form, arm = forms[name], pinsing.load(name)
    text = form.system()
    commands = determinant_in_singular(arm)
    # On each family; and a power of the product of their equations is a multiple of it.
    commands.append("poly F = 1;")
    for k in ideals(text):
        commands.append(f"ideal G_{k} = imap(R,{k}); reduce(D,std(G_{k}+K)) == 0;")
        commands.append(f"F = reduce(F*G_{k}[1],K);")
    commands.append("reduce(F*F,std(K+ideal(D))) == 0; D == 0;")
    # An equation less, or one of another length, is not the same: the check can fail.
    commands.append("reduce((F/G_F1[1])^2,std(K+ideal(D))) == 0;")
    commands.append("reduce(D,std(ideal(G_F1[1]+1/7)+K)) == 0;")
    told = asked(text, *commands)
    assert told == ["1"] * (len(ideals(text)) + 1) + ["0"] * 3
