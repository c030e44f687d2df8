"""Expressions of xacro files: the same values as Python's, and nothing but values."""

import json
import math
import tracemalloc
from pathlib import Path

import pytest
import xacro
from command_line import python
from xacro_escapes import ESCAPES, PLACES

from pinsing.description import child_jail
from pinsing.description.xacro_expression import FUNCTIONS, MATH, Function, Kinds, Refused, evaluate

KINDS = Kinds(xacro.YamlDictWrapper, xacro.YamlListWrapper, xacro.NameSpace)
DATA = xacro.YamlListWrapper.wrap(
    {"a": {"b": [1, {"c": 2.5}]}, "values": 3, "name": "arm", "list": [{"x": 1}, {"x": 2}]}
)


def namespace(**names):
    space = xacro.NameSpace()
    for name, value in names.items():
        dict.__setitem__(space, name, value)
    return space


NAMES = {
    **FUNCTIONS, **MATH, "math": namespace(**MATH), "data": DATA, "side": "left", "n": 3,
    "xyz": "0.1 0.2 0.3",
}  # fmt: skip
PLAIN_NAMES = {
    "math": math, "data": DATA, **{k: v for k, v in vars(math).items() if k[0] != "_"},
    **{k: NAMES[k] for k in ("side", "n", "xyz")},
}  # fmt: skip

SAME_AS_PYTHON = [
    "1 + 2 * 3 - 4 / 5 // 1 % 7", "-n ** 2 + ~n", "2 ** 0.5 + 2 ** -1", "1 << 4 | 3 & 6 ^ 1",
    "7 >> 1", "0x1f + 0b11 + 1_000", "1 < n <= 3 != 4", "1 < 0 < (1 / 0 if False else 1)",
    "n == 3 and side or 'none'", "not n and 1 / 0", "'a' if side == 'left' else 'b'",
    "side + '_' + str(n)", "side in ('left', 'right') and 'x' not in side", "None is None",
    "[1, 2.5, 'a', True, None]", "(1,) + (2, 3)", "[1, 2] + [3] * 2", "{'a': 1, 'b': [2]}['b'][0]",
    "dict(a=1, b=2)['b']", "dict([('a', 1)])", "'abcdef'[1:-1:2] + 'abc'[-1]", "[1, 2, 3][::-1]",
    "[float(x) * 2 for x in xyz.split() if x != '0.2']",
    "[(i, j) for i in range(3) for j in range(i)]", "sum([x * x for x in range(10)])",
    "sum(x for x in (1, 2))", "any(x > 2 for x in [1, 2, 3]) and all([])",
    "' '.join([str(v) for v in sorted([3, 1, 2], reverse=True)])", "xyz.split(' ')[1]",
    "side.upper().startswith('LE')", "side.replace('left', 'right').strip('r')",
    "'%s_%03d %.3f' % (side, n, pi)", "'%s' % side",
    "sin(pi / 2) + math.cos(math.pi) + radians(90) + degrees(1)",
    "math.hypot(3, 4) + atan2(1, 2) + sqrt(2)", "math.floor(2.7) + ceil(2.1) + trunc(2.9)",
    "round(2.675, 2) + round(2.5) + abs(-3)",
    "min(1, 2) + max([1, 2, 3]) + max('a', 'bb').count('b')",
    "len([1, 2]) + int('12') + int('1f', 16) + int(2.9) + float('1e3')", "list(zip([1, 2], 'ab'))",
    "list(enumerate('ab', 1))", "list(range(5))[1:3]", "bool('') or bool('x')",
    "data.a.b[1].c + data['values']", "data['a']['b'][0]", "data.get('nope', 7)", "'name' in data",
    "[item.x for item in data.list]", "len(data.list) + len(data)", "str(data.a)",
]  # fmt: skip


@pytest.mark.parametrize("text", SAME_AS_PYTHON)
def test_values_are_those_of_python(text):
    expected = eval(text, {}, PLAIN_NAMES)  # texts of this file only
    found = evaluate(text, NAMES, KINDS)
    assert found == expected
    assert type(found) is type(expected)
    assert str(found) == str(expected)


@pytest.mark.parametrize(
    "text",
    [
        "nope", "1 / 0", "'a' + 1", "[1][3]", "data.nope", "int('x')", "1 +", "n(1)", "len(1)",
        "x = 1",
    ],
)  # fmt: skip
def test_errors_are_those_of_python(text):
    with pytest.raises(Exception) as expected:
        eval(text, {}, dict(PLAIN_NAMES))  # texts of this file only
    with pytest.raises(expected.type) as found:
        evaluate(text, NAMES, KINDS)
    if expected.type is not SyntaxError:
        assert str(found.value) == str(expected.value)


@pytest.mark.parametrize(
    "text",
    [
        "9 ** 9 ** 9", "2 ** 10 ** 8", "1 << 10 ** 9", "'a' * 10 ** 9", "[0] * 10 ** 9",
        "[[0] * 10 ** 5 for i in range(10 ** 5)]", "range(10 ** 9)", "'%1000000000d' % 1",
        "'%*d' % (10 ** 9, 1)", "'%.999999999f' % 1.0",
        "('a' * 10 ** 6).replace('a', 'a' * 10 ** 6)",
        "('a' * 10 ** 6).join(['a' * 10 ** 6] * 1000)", "round(1, -10 ** 9)", "int('9' * 10 ** 5)",
        "'%.2000d' % 1", "sorted([1], key=abs)", "max(*[1, 2])",
        "sum([[0] * 10 ** 5] * 1000, [])",
        "(" * 90 + "1" + ")" * 90 + "+" + "-" * 100 + "1", "-" * 15_000 + "1", "(" * 10_000,
        "1+" * 15_000 + "1", "[" * 5000 + "]" * 5000, "a" * 30_000, "(-8) ** 0.5", "1j", "b'a'",
        "lambda: 1", "f'{n}'", "side.format(1)", "math", "[math]", "str(math)", "math['__doc__']",
        "math.__doc__", "data.__class__", "[].append(1)", "data.update(a=1)", "data.pop('a')",
        r"'\udc00'", r"'\ud83d' + '\ude00'",
        pytest.param("[i for i in range(10 ** 5) for j in range(10 ** 5)]", marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_what_is_refused(text):
    with pytest.raises((Refused, SyntaxError, ValueError, TypeError)) as caught:
        evaluate(text, NAMES, KINDS)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    "text",
    [
        "'%(a(b))99999999d' % {'a(b)': 1}", "'%(a(b)c)-99999999s' % {'a(b)c': 1}",
        "('%(a)999s' * 10000) % {'a': 1}", "('%(a)s' * 10000) % {'a': 'a' * 1000}",
        "('%(a)d' * 10000) % {'a': 1 << 8000}",
    ],
)  # fmt: skip
def test_a_format_is_refused_before_it_takes_memory(text):
    tracemalloc.start()
    try:
        with pytest.raises(Refused):
            evaluate(text, NAMES, KINDS)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


def test_a_value_of_any_other_type_is_refused_where_it_turns_up():
    class Odd:
        def __add__(self, other):
            raise AssertionError("called")

        __getattr__ = __getitem__ = __eq__ = __radd__ = __add__

    names = {"odd": Odd(), "box": [Odd()], "made": Function("made", Odd), "len": len}
    for text in ("odd", "odd + 1", "odd.a", "odd['a']", "box[0]", "made()", "[x for x in box]"):
        with pytest.raises(Refused, match="a value of type Odd"):
            evaluate(text, names, KINDS)
    with pytest.raises(Refused, match="builtin_function"):  # what is no Function is not called
        evaluate("len('a')", names, KINDS)


@pytest.fixture(scope="module")
def attempts():
    script = Path(__file__).with_name("xacro_escapes.py")
    return json.loads(python(script, check=True, timeout=200).stdout)


@pytest.mark.slow
def test_no_escape_gets_through_any_place(attempts):
    assert len(attempts["results"]) == len(ESCAPES) * len(PLACES) > 2500
    assert attempts["seen"] == {}  # no file opened, nothing run, imported, connected or started
    through = {k: v for k, v in attempts["results"].items() if not v.startswith("!")}
    assert through == {}


def test_the_same_attempts_are_seen_where_xacro_evaluates_by_itself():
    code = (
        "import sys; sys.argv[1:] = ['plain']; import xacro_escapes as x\n"
        "x.ESCAPES = {'globals by vars': x.ESCAPES['globals by vars']}; x.main(True)"
    )
    seen = json.loads(python("-c", code, check=True, cwd=Path(__file__).parent).stdout)["seen"]
    assert sum("os.system" in " ".join(events) for events in seen.values()) > 20


WALL = """
import os, socket, sys, types
for name, folder in (("pinsing", sys.argv[1] + "/.."), ("pinsing.description", sys.argv[1])):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [folder]
from pinsing.description import child_jail
reason = child_jail.close_in()
print(reason or "closed")
deeds = dict(
    read=lambda: os.open(sys.argv[0] or "/etc/passwd", os.O_RDONLY),
    write=lambda: os.open("mark", os.O_CREAT | os.O_WRONLY),
    socket=lambda: socket.socket(),
    pair=lambda: socket.socketpair(),
    process=lambda: os.fork(),
    program=lambda: os.execv("/bin/true", ["true"]),
    signal=lambda: os.kill(os.getppid(), 0),
    folder=lambda: os.listdir("/"),
    stat=lambda: os.stat("/"),
    link=lambda: os.symlink("a", "b"),
)
for name, deed in deeds.items():
    try:
        deed()
        print(name, "done")
    except OSError as error:
        print(name, error.errno)
"""


def test_the_kernel_closes_the_child_in(tmp_path):
    done = python("-c", WALL, Path(child_jail.__file__).parent, cwd=tmp_path)
    first, *deeds = done.stdout.splitlines()
    if first != "closed":
        pytest.skip(first)
    assert done.returncode == 0, done.stderr
    assert len(deeds) == 10
    assert all(line.endswith(" 1") for line in deeds)  # not permitted
    assert list(tmp_path.iterdir()) == []
