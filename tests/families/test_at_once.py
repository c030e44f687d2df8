"""Several long equations that hold at once: which joints can be chosen, how the others follow."""

from dataclasses import replace

import numpy as np
import pytest

from pinsing.algebra.conditions import Branch
from pinsing.algebra.equation import Equation
from pinsing.families.at_once import at_once
from pinsing.families.describe import statement

SYMBOLS = ("q1", "q2", "q3", "q4", "q5")


def long_equation(seed, once, others, zero):
    """A random equation of 16 terms through a point; ``once`` enters once, the others twice."""
    rng = np.random.default_rng(seed)
    frequencies = np.zeros((16, 5), dtype=np.int64)
    frequencies[:, others] = rng.choice([-4, -2, 0, 2, 4], (16, len(others)))
    if once is not None:
        frequencies[:, once] = rng.choice([-2, 0, 2], 16)
        frequencies[1, once] = 2
    frequencies[2, others[0]], frequencies[3, others[-1]] = 4, 4
    frequencies[0] = 0
    cos, sin = rng.normal(size=(2, 16))
    sin[0] = 0.0
    return through(zero, frequencies, cos, sin)


def through(zero, frequencies, cos, sin):
    """An equation whose first term is the constant that makes it zero at a point."""
    powers = np.zeros_like(frequencies)
    e = Equation(SYMBOLS, frequencies, powers, cos, sin, np.zeros(5))
    cos = cos - np.where(np.arange(len(cos)) == 0, float(e(zero)), 0.0)
    return replace(e, cos=cos)


@pytest.fixture
def zero() -> np.ndarray:
    return np.random.default_rng(8).uniform(-1, 1, 5)


def test_more_equations_than_conditions_choose_among_the_values(zero: np.ndarray) -> None:
    first, second = long_equation(1, 1, (2, 3), zero), long_equation(6, 2, (3,), zero)
    third = Equation(
        SYMBOLS,
        np.concatenate([first.frequencies, second.frequencies]),
        np.concatenate([first.powers, second.powers]),
        np.concatenate([first.cos, 0.5 * second.cos]),
        np.concatenate([first.sin, 0.5 * second.sin]),
        np.zeros(5),
    )
    found = at_once(Branch((), (first, second, third)), zero, SYMBOLS)
    assert (found.follow, found.left) == (("q3", "q2"), 1)
    assert found.lines()[-1] == "the other equation says which of these values hold"


def test_other_sets_of_equations(zero: np.ndarray) -> None:
    """Where each joint enters with its double angle, too; one equation, and none; in one line."""
    pair = tuple(long_equation(k, None, (1, 2, 3), zero) for k in (5, 6))
    found = at_once(Branch((), pair), zero, SYMBOLS)
    assert (found.steps, len(found.follow)) == ((), 2)
    assert "by solving the equations together" in found.lines()[1]
    first, second = long_equation(1, 1, (2, 3), zero), long_equation(6, 2, (3,), zero)
    for few in ((first,), ()):
        assert at_once(Branch((), few), zero, SYMBOLS) is None
    both = [Branch((), (first, second))]
    assert len(statement(both, (), SYMBOLS, [False] * 5, True)) < 70
    said = statement(both, (), SYMBOLS, [False] * 5)
    assert said == "2 equations at once in q2, q3 and q4 [16 terms]"


def test_a_joint_that_an_equation_names_alone_is_given_nothing(zero: np.ndarray) -> None:
    """Of four equations one is about q5 only: a list of no joints was written, which failed."""

    def simple(*joints: int) -> Equation:
        frequencies = np.zeros((2, 5), dtype=np.int64)
        frequencies[1, list(joints)] = 2
        return through(zero, frequencies, np.array([0.0, 1.0]), np.array([0.0, 0.5]))

    long = long_equation(1, 1, (2, 3), zero)
    found = at_once(Branch((), (simple(4), simple(3, 4), simple(2, 3), long)), zero, SYMBOLS)
    assert found.follow == ("q5", "q4", "q3", "q2")
    assert found.steps[:2] == (
        "q5 has two solutions [2 terms]", "q4 has two solutions given q5 [2 terms]",
    )  # fmt: skip
