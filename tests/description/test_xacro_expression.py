"""Expressions of xacro files: the same values as Python's, and nothing but values."""

import json
import math
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xacro
from command_line import python
from golden import Golden

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

SAID = Path(__file__).with_name("said")
ESCAPES, PLACES, REFUSED = (
    Golden(SAID / f"{name}.txt") for name in ("escapes", "places", "refused")
)
TOO_LONG = {
    "deep signs": "(" * 90 + "1" + ")" * 90 + "+" + "-" * 100 + "1", "signs": "-" * 15_000 + "1",
    "open": "(" * 10_000, "sum": "1+" * 15_000 + "1", "lists": "[" * 5000 + "]" * 5000,
    "name": "a" * 30_000,
}  # fmt: skip


def outcome(evaluated: Callable[..., Any], *given: Any) -> tuple[type, str]:
    """The type and the text of a value, or of an error."""
    try:
        value = evaluated(*given)
    except SyntaxError:
        return SyntaxError, "in other words"
    except Exception as error:
        value = error
    return type(value), str(value)


@pytest.mark.parametrize("text", (SAID / "as_python.txt").read_text().splitlines())
def test_values_and_errors_are_those_of_python(text):
    expected = outcome(eval, text, {}, dict(PLAIN_NAMES))  # texts of that file only
    assert outcome(evaluate, text, NAMES, KINDS) == expected


@pytest.mark.parametrize("head", REFUSED.heads())
def test_what_is_refused(head):
    text = head.removesuffix(" (slow)")
    kind, said = outcome(evaluate, TOO_LONG.get(text, text), NAMES, KINDS)
    assert issubclass(kind, Exception)
    assert len(said) < 200
    REFUSED.hold(head, f"{kind.__name__}: {said}")


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


def tried(escapes, places, *words):
    """What came of some of the escapes in some of the places."""
    given = [
        {head: golden.text(head).strip() for head in heads}
        for golden, heads in ((ESCAPES, escapes), (PLACES, places))
    ]
    script = Path(__file__).with_name("xacro_escapes.py")
    done = python(script, *words, input=json.dumps(given), check=True, timeout=200)
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def attempts():
    return tried(ESCAPES.cases, ["attribute"])["results"]


@pytest.mark.parametrize("head", ESCAPES.cases)
def test_an_escape_is_refused(head, attempts):
    ESCAPES.hold(head, attempts[f"{head} | attribute"].splitlines()[0])


@pytest.mark.slow
def test_no_escape_gets_through_any_place():
    attempts = tried(ESCAPES.cases, PLACES.cases)
    assert len(attempts["results"]) == len(ESCAPES.cases) * len(PLACES.cases) > 2500
    assert attempts["seen"] == {}  # no file opened, nothing run, imported, connected or started
    assert [k for k, v in attempts["results"].items() if not v.startswith("!")] == []


def test_the_same_attempts_are_seen_where_xacro_evaluates_by_itself():
    seen = tried(["globals by vars"], PLACES.cases, "plain")["seen"]
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
