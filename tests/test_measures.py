"""Measures against their definitions, worked by hand or by another formula."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from hypothesis.extra import numpy as hnp

from pinsing import measures

FLOATS = st.floats(-10, 10, allow_nan=False, width=32)


def random_rank(rng: np.random.Generator, m: int, n: int, r: int) -> np.ndarray:
    return rng.normal(size=(m, r)) @ rng.normal(size=(r, n))


@pytest.mark.parametrize("shape", [(6, 6), (6, 7), (3, 7), (6, 4), (2, 3)])
def test_against_direct_formulas(rng, shape):
    J = rng.normal(size=(50, *shape))
    gram = J @ J.swapaxes(1, 2) if shape[0] <= shape[1] else J.swapaxes(1, 2) @ J
    eigenvalues = np.linalg.eigvalsh(gram)[:, ::-1]
    np.testing.assert_allclose(measures.singular_values(J) ** 2, eigenvalues, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(
        measures.manipulability(J), np.sqrt(np.linalg.det(gram)), rtol=1e-8, atol=1e-12
    )
    np.testing.assert_allclose(
        measures.condition_number(J), [np.linalg.cond(j, 2) for j in J], rtol=1e-9
    )
    assert (measures.rank(J) == min(shape)).all()
    if shape[0] == shape[1]:
        np.testing.assert_allclose(measures.determinant(J), np.linalg.det(J))
    else:
        np.testing.assert_allclose(measures.determinant(J), np.linalg.det(gram), rtol=1e-8)


@pytest.mark.parametrize("r", [0, 1, 3, 5])
def test_rank_of_deficient_matrices(rng, r):
    J = np.array([random_rank(rng, 6, 7, r) for _ in range(100)])
    assert (measures.rank(J) == r).all()
    assert np.isinf(measures.condition_number(J)).all()
    assert (measures.sigma_ratio(measures.singular_values(J)) <= measures.SINGULAR_RTOL).all()


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
    J = np.zeros((4, 6, 7))
    assert (measures.rank(J) == 0).all()
    assert (measures.manipulability(J) == 0).all()
    assert np.isinf(measures.condition_number(J)).all()
    assert (measures.sigma_ratio(measures.singular_values(J)) == 0).all()
    ellipsoid = measures.velocity_ellipsoid(J[:, :3])
    assert (ellipsoid.radii == 0).all()
    np.testing.assert_allclose(np.linalg.det(ellipsoid.axes), 1)
    with pytest.raises(ValueError, match="3 rows, got 6"):
        measures.velocity_ellipsoid(np.eye(6))


def test_manipulability_is_no_nan_and_no_noise_near_singularities(rng):
    """sqrt(det(J J^T)) is NaN for about half of these; the product of sigmas is not."""
    J = np.array([random_rank(rng, 6, 6, 5) for _ in range(300)])
    naive = np.linalg.det(J @ J.swapaxes(1, 2))
    assert (naive < 0).any()  # the trap is real
    w = measures.manipulability(J)
    scale = measures.singular_values(J)[:, :5].prod(axis=1)
    assert (w >= 0).all()
    assert (w <= 1e-13 * np.maximum(scale, 1) * 100).all()


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
    np.testing.assert_allclose(
        axes @ axes.swapaxes(1, 2), np.tile(np.eye(3), (40, 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(axes), 1)  # right-handed
    gram = (axes * radii[:, None, :] ** 2) @ axes.swapaxes(1, 2)
    np.testing.assert_allclose(gram, J @ J.swapaxes(1, 2), atol=1e-12)
    assert (np.diff(radii, axis=1) <= 0).all()
    if n < 3:
        assert (radii[:, n:] == 0).all()
