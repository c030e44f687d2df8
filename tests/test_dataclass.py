"""Dataclasses that are cheap to define: the same as the standard library's in all that they do."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import field
from typing import ClassVar

import pytest

from pinsing._dataclass import dataclass


def described(decorate, **how):
    """One class, made by either decorator."""

    @decorate(**how)
    class Arm:
        """An arm."""

        kind: ClassVar[str] = "serial"

        name: str
        joints: int = 6
        limits: list[float] = field(default_factory=list)
        note: str = field(default="", compare=False, repr=False)
        tried: int = field(default=3, init=False)
        said: list[str] = field(default_factory=lambda: ["x"], init=False)
        unit: str = field(default="m", kw_only=True, metadata={"json": False})

    return Arm


@dataclass(frozen=True)
class Point:
    x: float
    y: float = 0.0


@dataclass(frozen=True, eq=False)
class Marked(Point):
    """A base that is one, too."""

    mark: str = "o"

    def __post_init__(self) -> None:
        object.__setattr__(self, "mark", self.mark * 2)


HOW = [
    {},
    {"frozen": True},
    {"frozen": True, "eq": False},
    {"eq": False},
    {"frozen": True, "eq": False, "repr": False},
]


@pytest.mark.parametrize("how", HOW, ids=str)
def test_it_does_what_the_standard_one_does(how):
    theirs, ours = (described(d, **how) for d in (dataclasses.dataclass, dataclass))
    assert str(inspect.signature(ours)) == str(inspect.signature(theirs))
    assert ours.__doc__ == theirs.__doc__
    assert ours.__match_args__ == theirs.__match_args__
    assert ours.kind == "serial"
    for name in ("__init__", "__eq__", "__hash__", "__setattr__"):
        assert (name in vars(ours)) == (name in vars(theirs))
    for name in ("name", "default", "init", "repr", "compare", "hash", "kw_only", "metadata"):
        told = [[getattr(f, name) for f in dataclasses.fields(c)] for c in (ours, theirs)]
        assert told[0] == told[1]
    a, b = ours("a", 7, unit="mm"), theirs("a", 7, unit="mm")
    assert dataclasses.asdict(a) == dataclasses.asdict(b)
    assert a.limits is not ours("a").limits
    if how.get("repr", True):
        assert repr(a) == repr(b)
        assert "said=['x']" in repr(a)
        assert "note" not in repr(a)
    else:
        assert " object at " in repr(a)
    others = [("a", 7), ("a", 7, [], "other note"), ("a", 8), ("b", 7)]
    same = [[c(*o, unit="mm") == x for o in others] for c, x in ((ours, a), (theirs, b))]
    assert same[0] == same[1]
    assert same[0] == ([False] * 4 if how.get("eq") is False else [True, True, False, False])
    assert a != b
    if how.get("frozen"):
        for wrong in ("name", "kind"):
            with pytest.raises(dataclasses.FrozenInstanceError, match=f"assign to field '{wrong}'"):
                setattr(a, wrong, "b")
        with pytest.raises(dataclasses.FrozenInstanceError, match="delete field 'name'"):
            del a.name
    else:
        a.name = "b"
        assert a.name == "b"
    for wrong in ((), ("a", 1, [], "", 3)):
        for c in (ours, theirs):
            with pytest.raises(TypeError, match="argument"):
                c(*wrong)
    assert dataclasses.replace(ours("a"), joints=5).joints == 5


def test_hashes_are_those_of_the_standard_one():
    assert hash(Point(1, 2)) == hash((1, 2))
    assert len({Point(1), Point(1.0), Point(2)}) == 2
    unlike = dataclass(eq=True)(type("Loose", (), {"__annotations__": {"x": "int"}}))
    with pytest.raises(TypeError, match="unhashable"):
        hash(unlike(1))


def test_one_that_comes_out_of_a_pickle_needs_no_init_first():
    fresh = described(dataclass, frozen=True)
    made = fresh.__new__(fresh)
    vars(made).update(vars(described(dataclass, frozen=True)("a")))
    assert repr(made).endswith("Arm(name='a', joints=6, limits=[], tried=3, said=['x'], unit='m')")
    assert made == copy.copy(made)
    with pytest.raises(dataclasses.FrozenInstanceError):
        made.name = "b"
    assert pickle.loads(pickle.dumps(Point(1, 2))) == Point(1, 2)


def test_what_a_class_says_itself_stands():
    @dataclass(frozen=True)
    class Own:
        x: int

        def __eq__(self, other):
            return True

        def __repr__(self):
            return "own"

    assert repr(Own(1)) == "own"
    assert Own(1) == Own(2)
    assert hash(Own(3)) == hash((3,))


def test_a_class_may_stand_on_another():
    assert repr(Marked(1, mark="x")) == "Marked(x=1, y=0.0, mark='xx')"
    assert Marked(1) == Marked(1, mark="x")  # compared as a Point, since eq=False adds nothing
    assert Marked(1) != Point(1)
    assert dataclasses.is_dataclass(Marked)
    assert [f.name for f in dataclasses.fields(Marked)] == ["x", "y", "mark"]

    class Plain(Marked):
        def __init__(self) -> None:
            super().__init__(5)

    plain = Plain()
    plain.more = 1  # no field, and of a class that is no dataclass itself
    assert (plain.x, plain.mark, plain.more) == (5, "oo", 1)
    with pytest.raises(dataclasses.FrozenInstanceError):
        plain.x = 3


@pytest.mark.parametrize("above", [dataclass, dataclasses.dataclass])
@pytest.mark.parametrize("below", [dataclass, dataclasses.dataclass])
def test_it_and_the_standard_one_may_stand_on_each_other(above, below):
    @above(frozen=True)
    class Base:
        x: int

    @below(frozen=True)
    class Derived(Base):
        y: int = 2

    assert repr(Derived(1)).endswith("Derived(x=1, y=2)")
    assert dataclasses.replace(Derived(1), y=3) == Derived(1, 3) != Derived(1)
    for wrong in ("x", "y"):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(Derived(1), wrong, 5)
    with pytest.raises(TypeError, match="cannot inherit non-frozen dataclass from a frozen one"):
        below(type("Thawed", (Base,), {"__annotations__": {"z": "int"}}))
    loose = above(type("Loose", (), {"__annotations__": {"x": "int"}}))
    with pytest.raises(TypeError, match="cannot inherit frozen dataclass from a non-frozen one"):
        below(frozen=True)(type("Frozen", (loose,), {"__annotations__": {"z": "int"}}))


def test_nothing_is_compiled_before_it_is_asked_for(monkeypatch):
    compiled = []
    monkeypatch.setattr(
        "builtins.exec", lambda text, *scopes, run=exec: compiled.append(text) or run(text, *scopes)
    )
    arm = described(dataclass, frozen=True)
    assert compiled == []
    one, other = arm("a"), arm("b")
    assert len(compiled) == 1
    assert one != other
    assert len(compiled) == 2
    with pytest.raises(TypeError, match="unhashable"):  # it has a list
        hash(one)
    assert len(compiled) == 3
    repr(one)
    arm("c")
    assert len(compiled) == 3
