"""JSON both ways, and refusal of damaged data."""

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st

from pinsing.errors import OptionError, ResultError
from pinsing.interface import JsonResult


@dataclass(frozen=True)
class Leaf:
    value: float
    label: str | None
    point: npt.NDArray[np.float64]


@dataclass(frozen=True)
class Tree(JsonResult):
    schema: ClassVar[str] = "pinsing.test.Tree/1"

    name: str
    count: int
    good: bool
    numbers: npt.NDArray[np.float64]
    flags: npt.NDArray[np.bool_]
    indices: npt.NDArray[np.int64]
    pair: tuple[float, int]
    words: tuple[str, ...]
    nested: tuple[tuple[float, ...], ...]
    leaf: Leaf
    leaves: tuple[Leaf, ...]
    maybe: Leaf | None
    table: Mapping[str, float]
    hidden: int = field(default=5, metadata={"json": False})


@dataclass(frozen=True)
class Choosy(JsonResult):
    schema: ClassVar[str] = "pinsing.test.Choosy/1"

    level: float

    def __post_init__(self) -> None:
        if self.level < 0:
            raise OptionError("level is negative")


@dataclass(frozen=True)
class Shown(JsonResult):
    schema: ClassVar[str] = "pinsing.test.Shown/1"

    names: tuple[str, ...]
    values: npt.NDArray[np.float64]

    def __str__(self) -> str:
        return ", ".join(f"{n} = {v}" for n, v in zip(self.names, self.values, strict=True))


def tree(**changes: Any) -> Tree:
    leaf = Leaf(math.inf, None, np.array([1.0, np.nan, -np.inf]))
    made = Tree(
        name="größe ½",
        count=3,
        good=True,
        numbers=np.array([[0.1, np.inf], [np.nan, -np.inf]]),
        flags=np.array([True, False]),
        indices=np.array([[1, 2], [3, 4]]),
        pair=(math.pi, 2),
        words=("a", "inf"),
        nested=((1.0, math.nan), ()),
        leaf=leaf,
        leaves=(leaf, Leaf(0.5, "x", np.zeros((2, 3)))),
        maybe=None,
        table={"a": 1.5, "b": math.inf},
    )
    return dataclasses.replace(made, **changes)


def damaged(**changes: Any) -> Tree:
    """Read one whose plain data were changed: mistakes.txt says what comes of it."""
    return Tree.from_dict({**tree().to_dict(), **changes})


def missing(name: str) -> Tree:
    data = tree().to_dict()
    del data[name]
    return Tree.from_dict(data)


@pytest.mark.parametrize("more", [{}, {"maybe": Leaf(1.0, "here", np.zeros(0)), "leaves": ()}])
def test_round_trip(more):
    """With their types: all that the parts of the two say of themselves is the same."""
    one = tree(**more)
    for text in (one.to_json(), one.to_json(indent=None)):
        back = Tree.from_json(text)
        assert str(vars(back)) == str(vars(one))
        assert back.to_json() == one.to_json()
    assert Choosy.from_json(Choosy(1.0).to_json()) == Choosy(1.0)
    assert str(Shown.from_dict(Shown(("a", "b"), np.arange(2.0)).to_dict())) == "a = 0.0, b = 1.0"


def test_text_is_strict_json():
    def refuse(token: str) -> None:
        raise AssertionError(f"{token} is no JSON")

    data = json.loads(tree().to_json(), parse_constant=refuse)
    assert next(iter(data)) == "schema"
    assert data["schema"] == "pinsing.test.Tree/1"
    assert data["numbers"] == [[0.1, "inf"], ["nan", "-inf"]]
    assert data["flags"] == [True, False]
    assert "hidden" not in data


@given(st.lists(st.floats(), min_size=1), st.floats(allow_nan=False), st.text())
def test_every_number_comes_back_to_the_last_bit(numbers, value, name):
    one = tree(numbers=np.array(numbers), pair=(value, 1), name=name)
    back = Tree.from_json(one.to_json())
    np.testing.assert_array_equal(back.numbers, one.numbers)
    assert back.pair[0] == value
    assert back.name == name


def test_numpy_scalars_become_plain():
    one = tree(count=np.int64(4), good=np.bool_(False), pair=(np.float32(0.5), np.int32(1)))
    back = Tree.from_json(one.to_json())
    assert (back.count, back.good, back.pair) == (4, False, (0.5, 1))


@pytest.mark.parametrize("bad", ["a" * 5000, "\x1b[31m\n", "\ud800" * 300])
def test_refusals_stay_short_and_printable(bad: str) -> None:
    good = Shown(("a",), np.array([1.0])).to_dict()
    for data in ({**good, "values": [bad]}, {**good, "schema": bad}, {**good, "values": {bad: 1}}):
        with pytest.raises(ResultError) as caught:
            Shown.from_dict(data)
        assert len(str(caught.value)) < 400
        assert str(caught.value).isprintable()
