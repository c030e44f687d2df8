"""Measures against their definitions, worked by hand or by another formula."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from pinsing import measures

FLOATS = st.floats(-10, 10, allow_nan=False, width=32)


@pytest.mark.parametrize("missing", [0, 1, 2, None])
@pytest.mark.parametrize("shape", [(6, 6), (6, 7), (3, 7), (6, 4), (2, 3)])
def test_against_direct_formulas(rng, shape, missing):
    """Also of less than full rank, where sqrt(det(J J^T)) is NaN for about half of them."""
    m, n = shape
    r = min(shape) - missing if missing is not None else 0
    J = rng.normal(size=(100, m, r)) @ rng.normal(size=(100, r, n))
    gram = J @ J.swapaxes(1, 2) if m <= n else J.swapaxes(1, 2) @ J
    sigma = measures.singular_values(J)
    eigenvalues = np.linalg.eigvalsh(gram)[:, ::-1]
    np.testing.assert_allclose(sigma**2, eigenvalues, rtol=1e-8, atol=1e-10)
    assert (measures.rank(J) == r).all()
    square = np.linalg.det(gram)
    ratio, w = measures.sigma_ratio(sigma), measures.manipulability(J)
    if missing == 0:
        det = np.linalg.det(J) if m == n else square
        np.testing.assert_allclose(measures.determinant(J), det, rtol=1e-8)
        np.testing.assert_allclose(w, np.sqrt(square), rtol=1e-8)
        condition = [np.linalg.cond(j, 2) for j in J]
        np.testing.assert_allclose(measures.condition_number(J), condition, rtol=1e-9)
        np.testing.assert_allclose(ratio, 1 / np.array(condition))
        return
    assert missing != 1 or m != n != 6 or (square < 0).any()  # the trap is real
    assert np.isinf(measures.condition_number(J)).all()
    assert (ratio <= measures.SINGULAR_RTOL).all()
    assert ((w >= 0) & (w <= 1e-11 * np.maximum(sigma[:, :r].prod(axis=1), 1))).all()


def test_special_matrices():
    sigma = np.array([4.0, 2.0, 1.0, 1e-17, 0.0])
    J = np.diag(sigma)
    assert measures.sigma_ratio(sigma, 3) == pytest.approx(0.25)
    assert measures.condition_number(J, 3) == pytest.approx(4)
    assert measures.manipulability(J, 3) == pytest.approx(8)
    assert np.isinf(measures.condition_number(J))
    assert measures.manipulability(J) == 0
    assert measures.determinant(np.diag([1.0, -2.0, 3.0])) == pytest.approx(-6)
    J = np.diag([1e6, 1.0, 1e-2])
    assert (measures.rank(J), measures.rank(J, rtol=1e-7), measures.rank(1e-12 * J)) == (3, 2, 3)
    ellipsoid = measures.velocity_ellipsoid(np.zeros((4, 3, 7)))
    assert (ellipsoid.radii == 0).all()
    np.testing.assert_allclose(np.linalg.det(ellipsoid.axes), 1)
    with pytest.raises(ValueError, match="3 rows, got 6"):
        measures.velocity_ellipsoid(np.eye(6))


@given(
    hnp.arrays(np.float64, hnp.array_shapes(min_dims=2, max_dims=4, max_side=7), elements=FLOATS)
)
def test_stacks_equal_single_matrices(J):
    stack = J.reshape(-1, *J.shape[-2:])
    for measure in (measures.manipulability, measures.condition_number, measures.rank):
        value = np.asarray(measure(J))
        assert value.shape == J.shape[:-2]
        assert not np.isnan(value).any()
        np.testing.assert_array_equal(value.ravel(), [measure(j) for j in stack])
    sigma = measures.singular_values(J)
    assert sigma.shape == (*J.shape[:-2], min(J.shape[-2:]))
    assert (np.diff(sigma, axis=-1) <= 0).all()
    ratio = measures.sigma_ratio(sigma)
    assert ((ratio >= 0) & (ratio <= 1)).all()


@pytest.mark.parametrize("n", [1, 2, 3, 6, 7])
def test_ellipsoid_is_the_image_of_the_unit_ball(rng, n):
    J = rng.normal(size=(40, 3, n))
    axes, radii = measures.velocity_ellipsoid(J)
    assert (axes.shape, radii.shape) == ((40, 3, 3), (40, 3))
    np.testing.assert_allclose(axes @ axes.swapaxes(1, 2) - np.eye(3), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(axes), 1)  # right-handed
    gram = (axes * radii[:, None, :] ** 2) @ axes.swapaxes(1, 2)
    np.testing.assert_allclose(gram, J @ J.swapaxes(1, 2), atol=1e-12)
    assert (np.diff(radii, axis=1) <= 0).all()
    if n < 3:
        assert (radii[:, n:] == 0).all()
