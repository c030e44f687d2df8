"""Singular values of the batch kernel against LAPACK, on every instruction set here."""

from __future__ import annotations

import os

import numpy as np
import pytest
from batch_cases import close, lapack, matrices

from pinsing._batch import engine

if not engine.available():
    if os.environ.get("PINSING_REQUIRE_ENGINE"):
        raise RuntimeError(engine.unavailable_reason())
    pytest.skip(f"{engine.unavailable_reason()}", allow_module_level=True)

pytestmark = pytest.mark.parametrize("isa", engine.isa_names())

SHAPES = [(6, 7), (6, 6), (6, 4), (5, 6), (3, 7), (3, 3), (2, 5), (1, 4), (6, 9), (4, 16), (6, 32)]


@pytest.mark.parametrize(("m", "n"), SHAPES)
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


def test_small_values_are_relatively_accurate_where_the_data_allow(isa: str) -> None:
    # Rows of very different length, orthogonal: their lengths are the singular values.
    lengths = 10.0 ** -np.arange(0, 90, 15)
    A = np.diag(lengths) @ np.linalg.qr(np.random.default_rng(3).standard_normal((7, 6)))[0].T
    S = engine.svdvals(A[None], isa=isa)[0]
    np.testing.assert_allclose(S, lengths, rtol=1e-14)


def test_matrices_that_do_not_converge_go_to_lapack(isa: str) -> None:
    A = np.random.default_rng(4).standard_normal((500, 6, 7))
    out = np.empty((500, 6))
    unfinished = engine._kernel.svdvals(A, out, isa, 1, 3)
    assert 400 < unfinished <= 500
    assert np.isnan(out).all(axis=1).sum() == unfinished == np.isnan(out).any(axis=1).sum()
    S = engine.svdvals(A, isa=isa, max_sweeps=3)
    assert close(S, lapack(A))


def test_ordinary_matrices_converge_in_the_kernel(isa: str) -> None:
    # Else the fallback would hide a kernel that never converges.
    for name, A, _ in matrices(6, 7, 200):
        out = np.empty((len(A), 6))
        unfinished = engine._kernel.svdvals(A, out, isa, 1, engine._MAX_SWEEPS)
        assert unfinished <= (4 if name in ("sparse", "integers", "wild") else 0), name


def test_matrices_wider_than_the_kernel_go_to_numpy(isa: str) -> None:
    A = np.random.default_rng(5).standard_normal((5, 7, 8))
    np.testing.assert_allclose(engine.svdvals(A, isa=isa), lapack(A), rtol=1e-13)
    with pytest.raises(ValueError, match="not finite"):
        engine.svdvals(np.full((2, 7, 8), np.nan), isa=isa)
