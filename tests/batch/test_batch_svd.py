"""Singular values of the batch kernel against LAPACK, on every instruction set here."""

import numpy as np
import pytest
from batch_cases import close, lapack, matrices
from kernel import require_kernel
from tiers import sampled, tiered_rows

from pinsing._batch import engine
from pinsing.measures import Chain

require_kernel()

pytestmark = pytest.mark.parametrize("isa", engine.isa_names())

SHAPES = [(6, 7), (6, 6), (6, 4), (5, 6), (3, 7), (3, 3), (2, 5), (1, 4), (6, 9), (4, 16), (6, 32)]


@pytest.mark.parametrize(("m", "n"), sampled(tiered_rows(SHAPES, (SHAPES[0], *SHAPES[2:7]))))
def test_svdvals_are_lapacks(isa: str, m: int, n: int) -> None:
    N = 1000 if n in (6, 7) else 200
    for name, A, expected in matrices(m, n, N):
        S = engine.svdvals(A, isa=isa)
        assert S.shape == (len(A), min(m, n))
        assert (np.diff(S, axis=1) <= 0).all(), name
        assert (S >= 0).all(), name
        assert close(S, expected), name


@pytest.mark.slow
@pytest.mark.parametrize(("m", "n"), [(6, 7), (6, 6)])
def test_svdvals_are_lapacks_at_length(isa: str, m: int, n: int) -> None:
    total = 0
    for name, A, expected in matrices(m, n, 10_000):
        total += len(A)
        assert close(engine.svdvals(A, isa=isa), expected), name
    assert total >= 200_000


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
    assert np.abs(S - lengths).max() <= 5e-15
    assert np.abs(S - lapack(A)).max() <= 5e-15
    # Eigenvalues of A A^T would be off by as much as the root of that.
    tall = 10.0 ** -np.arange(0, 12, 2)
    B = np.array([np.diag(tall) @ np.linalg.qr(M.T)[0].T for M in A])
    np.testing.assert_allclose(engine.svdvals(B, isa=isa)[:, -1], 1e-10, rtol=5e-5)


def test_larger_matrices_go_to_lapack(isa: str) -> None:
    A = np.random.default_rng(5).standard_normal((5, 7, 8))
    np.testing.assert_allclose(engine.svdvals(A, isa=isa), lapack(A), rtol=1e-13)


def test_jacobians_that_overflow_are_refused(isa: str) -> None:
    chain = Chain(np.array([np.eye(3)] * 2), np.array([[0.0, 0, 0], [1, 0, 0]]), np.array([False]))
    with pytest.raises(ValueError, match="a Jacobian overflows"):
        engine.singular_values(chain, np.zeros((3, 1)), length_scale=1e-320, isa=isa)
