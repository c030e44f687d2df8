"""The compiled batch kernel against NumPy, LAPACK and Pinocchio, on every instruction set here."""

import itertools
import os
import time
from collections.abc import Iterator

import numpy as np
import pytest
from batch_cases import (
    ROBOTS,
    close,
    lapack,
    matrices,
    random_chain,
    reference_jacobian,
)
from command_line import python
from kernel import require_kernel
from tiers import sampled, tiered, tiered_rows

from pinsing._batch import engine
from pinsing.measures import Chain
from pinsing.robot.nominal import flatten

require_kernel()

pytestmark = pytest.mark.parametrize("isa", engine.isa_names())
LINK = Chain(np.array([np.eye(3)] * 2), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([False]))
"""One joint about z, and its tip at x = 1."""


# ---- Jacobians


@pytest.mark.parametrize("kind", ["revolute", "prismatic", "mixed"])
@pytest.mark.parametrize("n", tiered([*range(1, 10), 12, 20, 33], [1, 3, 6, 7, 20, 33]))
def test_random_chains(isa: str, n: int, kind: str) -> None:
    """Jacobians, and the singular values of some of their rows, as those of LAPACK."""
    chain = random_chain(n, kind, seed=n)
    Q = np.random.default_rng(n + 1).uniform(-4, 4, (37, n))
    Q[::3, n // 2] = 0.0
    expected = np.array([reference_jacobian(chain, q) for q in Q])
    J = engine.jacobians(chain, Q, isa=isa)
    assert J.shape == (37, 6, n)
    scale = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(J, expected, rtol=0, atol=4e-15 * n * scale)
    every = [0, 1, 2, 3, 4, 5], [0, 1, 2], [3, 4, 5], [5, 0], [4], [0, 2, 5], [3, 4, 5, 0, 1, 2]
    for rows, length in itertools.product(every, (1.0, 0.3)):
        scaled = J[:, rows] / np.where(np.array(rows) < 3, length, 1.0)[:, None]
        S = engine.singular_values(chain, Q, rows=rows, length_scale=length, isa=isa)
        assert S.shape == (37, min(len(rows), n))
        assert close(S, lapack(scaled))


def test_sine_and_cosine_at_any_angle(isa: str) -> None:
    # vx = -sin q, vy = cos q, and nothing else.
    rng = np.random.default_rng(1)
    parts = [rng.uniform(-b, b, 20_000) for b in (1e-3, 1, 7, 1e3, 1e5, 1e6, 1.1e6, 1e9, 1e300)]
    k = np.arange(-4000, 4001)
    near = (k * (np.pi / 2))[:, None] * (1 + np.finfo(float).eps * np.arange(-3, 4))
    parts += [near.ravel(), k * 157 * (np.pi / 4), 10.0 ** rng.uniform(-310, 0, 1000)]
    parts.append([0.0, -0.0, 1e6, -1e6, np.nextafter(1e6, 2e6), 1.7e308, 5e-324])
    q = np.concatenate(parts)
    J = engine.jacobians(LINK, q[:, None], isa=isa)[:, :, 0]
    for got, expected in ((-J[:, 0], np.sin(q)), (J[:, 1], np.cos(q))):
        assert np.abs(got - expected).max() < 2e-16
        assert (np.abs(got - expected) <= 2 * np.spacing(np.abs(expected))).all()
    np.testing.assert_array_equal(J[:, 2:], np.tile([0.0, 0, 0, 1], (len(q), 1)))


# ---- singular values of chains


def chains() -> Iterator[tuple[str, Chain, np.ndarray, float]]:
    """By name: chains, configurations, of which many are singular or nearly so, length scales."""
    rng = np.random.default_rng(5)
    for name, robot in ROBOTS.items():
        chain = flatten(robot())
        Q = rng.uniform(-3, 3, (600, chain.n))
        Q[::3, -2] = 0.0  # singular wrists
        for length in (1.0, 0.3, 1e-3, 1e-9, 1e9):
            yield f"{name}, {length}", chain, Q, length
        # All joints at multiples of 90 degrees, and near them: rank lost once or several times.
        Q = rng.integers(-2, 3, (3000, chain.n)) * (np.pi / 2)
        Q[1000:] += 10 ** rng.uniform(-17, -2, (2000, 1)) * rng.standard_normal((2000, chain.n))
        yield f"{name} at right angles", chain, Q, 1.0
    plain = random_chain(6, "revolute", 12)
    for size in (1e3, 1e5, 1e150):
        chain = Chain(plain.R, plain.t * size, plain.prismatic)
        yield f"links of {size}", chain, rng.uniform(-3, 3, (100, 6)), 1.0
    # A tip on the last axis: the last column is a unit vector, and values are begun with it.
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    for n in (6, 7, 8, 9, 13):
        Q = rng.uniform(-3, 3, (400, n))
        Q[:100] = rng.integers(-4, 5, (100, n)) * np.pi / 4
        Q[100:200] = Q[:100] + rng.standard_normal((100, n)) * 10.0 ** rng.uniform(
            -12, -2, (100, 1)
        )
        plain = random_chain(n, "revolute", n)
        plain.t[n, :2] = 0.0
        yield f"{n} joints, tip on the last axis", plain, Q, 1.0
        R = np.array([turn if k % 3 else np.eye(3) for k in range(n + 1)])
        t = plain.t * (np.arange(n + 1) % 2 == 0)[:, None]
        yield f"{n} joints at right angles", Chain(R, t, plain.prismatic), Q, 1.0


def test_values_of_a_chain_are_those_of_its_jacobians_whatever_the_split(isa: str) -> None:
    singular = 0
    for name, chain, Q, length in chains():
        J = engine.jacobians(chain, Q, threads=1, isa=isa)
        J[:, :3] /= length
        expected = lapack(J)
        how = {"length_scale": length, "threads": 1, "isa": isa}
        S = engine.singular_values(chain, Q, **how)
        assert close(S, expected), name
        parts = [engine.singular_values(chain, q, **how) for q in np.split(Q, range(7, len(Q), 7))]
        assert (np.concatenate(parts) == S).all(), name
        singular += (expected[:, -1] < 1e-9 * expected[:, 0]).sum()
    assert singular > 2000


def test_threads_and_chunks_do_not_change_a_bit(isa: str) -> None:
    chain = random_chain(7, "mixed", seed=7)
    rng = np.random.default_rng(7)
    N = 3 * engine._kernel.CHUNK + 5
    Q = rng.uniform(-3, 3, (N, 7))
    Q[rng.integers(0, N, 200)] = 0.0
    Q[rng.integers(0, N, 20), 0] = 1e7  # through the slow reduction, lane by lane
    # Regular ones beside clusters, deficient and extreme ones.
    A = np.concatenate([A[:40] for _, A, _ in matrices(6, 7, 40)])
    A = A[np.random.default_rng(7).permutation(len(A))]
    J = engine.jacobians(chain, Q, isa=isa, threads=1)
    S = engine.singular_values(chain, Q, isa=isa, threads=1)
    V = engine.svdvals(A, isa=isa, threads=1)
    for threads in (2, 3, 16, None):
        how = {"isa": isa, "threads": threads}
        assert np.array_equal(J, engine.jacobians(chain, Q, **how))
        assert np.array_equal(S, engine.singular_values(chain, Q, **how))
        assert np.array_equal(V, engine.svdvals(A, **how))
    for i in (0, 1, 13, 4099, N - 1):
        assert np.array_equal(J[i], engine.jacobians(chain, Q[i : i + 1], isa=isa)[0])
        assert np.array_equal(S[i], engine.singular_values(chain, Q[i : i + 1], isa=isa)[0])
    for first, last in ((0, 1), (1, 4), (4, 13), (13, 200)):
        assert np.array_equal(V[first:last], engine.svdvals(A[first:last], isa=isa))
    order, other = rng.permutation(N), rng.permutation(len(A))
    assert np.array_equal(S[order], engine.singular_values(chain, Q[order], isa=isa))
    assert np.array_equal(V[other], engine.svdvals(A[other], isa=isa))
    beside = np.tile(np.eye(6, 7), (32, 1, 1))  # clusters of equal values only, by rotations
    beside[0] = A[17]
    assert np.array_equal(V[17], engine.svdvals(beside, isa=isa)[0])


def test_nothing_is_asked_or_less_than_there_are_threads(isa):
    chain = random_chain(6, "revolute", seed=9)
    assert engine.jacobians(chain, np.empty((0, 6)), isa=isa).shape == (0, 6, 6)
    assert engine.singular_values(chain, np.empty((0, 6)), isa=isa, rows=[0, 1]).shape == (0, 2)
    assert engine.svdvals(np.empty((0, 3, 4)), isa=isa).shape == (0, 3)
    assert engine.jacobians(chain, np.zeros((1, 6)), isa=isa, threads=8).shape == (1, 6, 6)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no affinity mask here")
def test_the_default_number_of_threads_is_that_of_the_affinity_mask(isa: str) -> None:
    whole = os.sched_getaffinity(0)
    assert engine.cpu_count() == len(whole)
    os.sched_setaffinity(0, {min(whole)})
    try:
        assert engine.cpu_count() == 1
    finally:
        os.sched_setaffinity(0, whole)


# ---- inputs and outputs


def test_input_of_any_layout_is_read_and_left_alone(isa: str) -> None:
    chain = random_chain(5, "mixed", seed=10)
    Q = np.random.default_rng(10).uniform(-3, 3, (40, 5))
    S = engine.singular_values(chain, Q, isa=isa)
    J = engine.jacobians(chain, Q, isa=isa)
    padded = np.full((80, 11), np.nan)
    padded[::2, 1::2] = Q
    frozen = Q.copy()
    frozen.flags.writeable = False
    for view in (np.asfortranarray(Q), padded[::2, 1::2], Q[::-1][::-1], Q.tolist(), frozen):
        assert np.array_equal(S, engine.singular_values(chain, view, isa=isa))
        assert np.array_equal(J, engine.jacobians(chain, view, isa=isa))
    assert np.array_equal(frozen, Q)
    whole = engine.jacobians(chain, np.rint(Q), isa=isa)
    assert np.array_equal(whole, engine.jacobians(chain, np.rint(Q).astype(int), isa=isa))
    assert np.array_equal(engine.svdvals(np.asfortranarray(J), isa=isa), engine.svdvals(J, isa=isa))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("at", [0, 5, 2047, 2048, 6999])
def test_values_that_are_not_finite_are_refused(isa: str, bad: float, at: int) -> None:
    chain = random_chain(6, "mixed", seed=12)
    Q = np.zeros((7000, 6))
    Q[at, 3] = bad
    Q[min(at + 3000, 6999), 0] = bad
    for threads, compute in itertools.product((1, 3), (engine.jacobians, engine.singular_values)):
        with pytest.raises(ValueError, match=rf"Q\[{at}\] holds a value that is not finite"):
            compute(chain, Q, isa=isa, threads=threads)
    with pytest.raises(ValueError, match="not finite"):
        engine.svdvals(Q.reshape(-1, 2, 3), isa=isa)


def test_wrong_arguments_are_refused(isa: str) -> None:
    chain = random_chain(6, "revolute", seed=13)
    Q = np.zeros((3, 6))
    for rows in ([], [6], [-1]):
        with pytest.raises(ValueError, match="rows"):
            engine.singular_values(chain, Q, rows=rows, isa=isa)
    for shape in ((6,), (3, 5), (1, 3, 6)):
        with pytest.raises(ValueError, match="must have shape"):
            engine.jacobians(chain, np.zeros(shape), isa=isa)
    with pytest.raises(ValueError, match="instruction set 'mmx'"):
        engine.jacobians(chain, Q, isa="mmx")
    with pytest.raises(ValueError, match="a Jacobian overflows"):
        engine.singular_values(LINK, np.zeros((3, 1)), length_scale=1e-320, isa=isa)


def test_the_kernel_itself_checks_shapes(isa: str) -> None:
    chain = random_chain(6, "revolute", seed=14)
    arrays = (chain.R, chain.t, chain.prismatic)
    with pytest.raises(ValueError, match="Q must have shape"):
        engine._kernel.jacobians(*arrays, np.zeros((3, 5)), isa, 1)
    less = (chain.R[1:].copy(), *arrays[1:])
    with pytest.raises(ValueError, match="R must have shape"):
        engine._kernel.jacobians(*less, np.zeros((3, 6)), isa, 1)
    with pytest.raises(ValueError, match="not covered"):
        engine._kernel.svdvals(np.zeros((3, 7, 7)), isa, 1)
    names = {
        float: "value noise reach curvature steepness amplitude phase rate_norm rate",
        np.int64: "family value_joint rate_joint power_joint",
    }
    flat = {name: np.zeros(0, kind) for kind, some in names.items() for name in some.split()}
    for name in ("value", "equation", "term", "rate", "power"):
        flat[f"{name}_start"] = np.zeros(1, np.int64)
    flat |= {"turn": np.zeros(2), "sliding": np.zeros(0, bool)}
    conditions, wide = engine._kernel.ConditionSet(0, flat, False), np.full(2, np.inf)
    for X in (np.array(0.0), np.zeros(2), np.zeros((3, 3)), np.zeros((1, 1, 2))):
        with pytest.raises(ValueError, match="Q must have shape"):
            conditions.nearest(X, -wide, wide, False, 1.0, 0.1, 10, 1)


def test_without_the_extension_the_reason_is_given(isa: str) -> None:
    code = (
        "import sys; sys.modules['pinsing._batch._kernel'] = None\n"
        "from pinsing._batch import engine\n"
        "assert not engine.available() and engine.isa_names() == ()\n"
        "assert engine.svdvals([[[-2.0]]]) == 2.0\n"
        "try: engine.module()\n"
        "except RuntimeError as error: print(error)\n"
        "assert 'reinstall' in engine.unavailable_reason()"
    )
    assert "compiler" in python("-c", code, check=True).stdout


# ---- singular values of matrices, against LAPACK

SHAPES = [(6, 7), (6, 6), (6, 4), (5, 6), (3, 7), (3, 3), (2, 5), (1, 4), (6, 9), (4, 16), (6, 32)]
MATRICES = [(m, n, 1000 if n in (6, 7) else 200) for m, n in SHAPES]
LONG = [pytest.param(6, n, 10_000, marks=pytest.mark.slow) for n in (7, 6)]


@pytest.mark.parametrize(
    ("m", "n", "N"), [*sampled(tiered_rows(MATRICES, (MATRICES[0], *MATRICES[2:7]))), *LONG]
)
def test_svdvals_are_lapacks_or_known_ones(isa: str, m: int, n: int, N: int) -> None:
    for name, A, expected in matrices(m, n, N):
        S = engine.svdvals(A, isa=isa)
        assert S.shape == expected.shape
        assert (np.diff(S, axis=1) <= 0).all(), name
        assert (S >= 0).all(), name
        assert close(S, expected), name


def test_most_matrices_are_settled_by_roots(isa):
    # Else rotations would hide that roots are never sure of themselves, as they are of no cluster.
    A = np.random.default_rng(3).standard_normal((20_000, 6, 7))
    seconds = {"regular": np.inf, "clusters": np.inf}
    for _ in range(5):
        for name, B in (("regular", A), ("clusters", np.linalg.qr(A.transpose(0, 2, 1))[0])):
            start = time.thread_time()
            engine.svdvals(B, isa=isa, threads=1)
            seconds[name] = min(seconds[name], time.thread_time() - start)
    assert seconds["regular"] < 0.75 * seconds["clusters"]


def test_graded_values_to_rounding_of_the_largest(isa: str) -> None:
    # Orthogonal rows of very different length, in any order: their lengths are the singular
    # values. A bidiagonalisation mixes rows, so the small ones have no digits of their own
    # (LAPACK's have none either); but nothing is off by more than rounding of the largest.
    lengths = 10.0 ** -np.arange(0, 90, 15)
    rows = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        orthogonal = np.linalg.qr(rng.standard_normal((7, 6)))[0].T
        ordered = np.diag(lengths) @ orthogonal
        rows += [ordered, ordered[rng.permutation(6)]]
    A = np.array(rows)
    S = engine.svdvals(A, isa=isa)
    for expected in (lengths, lapack(A)):
        assert np.abs(S - expected).max() <= 5e-15
    # Eigenvalues of A A^T would be off by as much as the root of that.
    tall = 10.0 ** -np.arange(0, 12, 2)
    B = np.array([np.diag(tall) @ np.linalg.qr(M.T)[0].T for M in A])
    np.testing.assert_allclose(engine.svdvals(B, isa=isa)[:, -1], 1e-10, rtol=5e-5)


def test_larger_matrices_go_to_lapack(isa: str) -> None:
    A = np.random.default_rng(5).standard_normal((5, 7, 8))
    np.testing.assert_allclose(engine.svdvals(A, isa=isa), lapack(A), rtol=1e-13)
