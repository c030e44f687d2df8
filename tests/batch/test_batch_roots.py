"""Singular values by roots, all at once, and by rotations: independent of neighbours."""

import time

import numpy as np
import pytest
from batch_cases import ROBOTS, lapack, matrices, random_chain, with_values
from kernel import require_kernel

from pinsing._batch import engine
from pinsing.measures import Chain
from pinsing.robot.nominal import flatten

require_kernel()

pytestmark = pytest.mark.parametrize("isa", engine.isa_names())

FROM_LAPACK = 5e-15


def off(S: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference relative to the largest value of each matrix."""
    scale = np.maximum(expected[:, :1], 1e-320)
    return float((np.abs(S / scale - expected / scale)).max())


def hard(m: int, n: int, N: int) -> np.ndarray:
    """Matrices of all kinds, mixed: regular ones beside clusters, deficient and extreme ones."""
    rng = np.random.default_rng(7)
    A = np.concatenate([A[:N] for _, A, _ in matrices(m, n, N)])
    return np.asarray(A[rng.permutation(len(A))])


@pytest.mark.slow
@pytest.mark.parametrize(("m", "n"), [(6, 7), (6, 6)])
def test_values_that_are_known_at_length(isa: str, m: int, n: int) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        s = 10 ** rng.uniform(-17, 0, (40_000, 6))
        s[::2, 1:3] = s[::2, :1] * (1 + 10 ** rng.uniform(-16, 0, (20_000, 2)))
        A = with_values(rng, s, m, n)
        assert off(engine.svdvals(A, isa=isa), -np.sort(-s, axis=1)) <= 3e-15


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
    # The sum of eigenvalues does not see a smallest one of 1e-12 of the largest.
    rng = np.random.default_rng(11)
    s = np.concatenate([rng.uniform(0.5, 1, (3000, 5)), 10 ** rng.uniform(-9, -3, (3000, 1))], 1)
    found = engine.svdvals(with_values(rng, s, 6, 7), isa=isa)
    assert np.abs(found + np.sort(-s, axis=1)).max() <= FROM_LAPACK


def test_a_value_depends_on_its_matrix_alone(isa: str) -> None:
    A = hard(6, 7, 40)
    together = engine.svdvals(A, isa=isa, threads=1)
    assert (engine.svdvals(A, isa=isa, threads=3) == together).all()
    order = np.random.default_rng(1).permutation(len(A))
    assert (engine.svdvals(A[order], isa=isa, threads=1) == together[order]).all()
    for first, last in ((0, 1), (1, 4), (4, 13), (13, 200)):
        assert (engine.svdvals(A[first:last], isa=isa) == together[first:last]).all()
    one = A[17]  # beside clusters of equal values only, which go to rotations
    beside = np.concatenate([one[None], np.tile(np.eye(6, 7), (31, 1, 1))])
    assert (engine.svdvals(beside, isa=isa)[0] == together[17]).all()


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("length_scale", [1.0, 0.3, 1e-3, 1e-9, 1e9])
def test_a_scaled_chain_has_the_values_of_scaled_rows(isa, name, length_scale):
    chain = flatten(ROBOTS[name]())
    Q = np.random.default_rng(5).uniform(-3, 3, (600, chain.n))
    Q[::3, -2] = 0.0  # singular wrists
    J = engine.jacobians(chain, Q, isa=isa)
    J[:, :3] /= length_scale
    S = engine.singular_values(chain, Q, length_scale=length_scale, isa=isa)
    assert off(S, lapack(J)) <= FROM_LAPACK


def test_sliding_joints_and_chosen_rows_have_the_values_of_their_jacobian(isa):
    rng = np.random.default_rng(8)
    for kind, rows in (("mixed", range(6)), ("revolute", (3, 4, 5, 0, 1, 2)), ("mixed", (0, 2, 5))):
        chain = random_chain(7, kind, 9)
        Q = rng.uniform(-2, 2, (300, 7))
        J = engine.jacobians(chain, Q, isa=isa)[:, list(rows)]
        S = engine.singular_values(chain, Q, rows=list(rows), isa=isa)
        assert off(S, lapack(J)) <= FROM_LAPACK
    plain = random_chain(6, "revolute", 12)
    Q = np.random.default_rng(13).uniform(-3, 3, (100, 6))
    for size in (1e3, 1e5, 1e150):
        chain = Chain(plain.R, plain.t * size, plain.prismatic)
        J = engine.jacobians(chain, Q, isa=isa)
        assert off(engine.singular_values(chain, Q, isa=isa), lapack(J)) <= FROM_LAPACK
