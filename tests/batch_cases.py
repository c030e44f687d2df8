"""Chains, matrices and independent references for the tests of the batch kernel."""

from collections.abc import Callable, Iterator

import numpy as np
import pinocchio as pin
from arms import data_robot, serial, ur5
from scipy.spatial.transform import Rotation

from pinsing.measures import Chain
from pinsing.robot.arm import Arm

ROBOTS: dict[str, Callable[[], Arm]] = {
    "ur5": ur5,
    "panda": lambda: data_robot("panda_description/urdf/panda.urdf", tip="panda_hand_tcp"),
}


def random_chain(n: int, kind: str, seed: int) -> Chain:
    rng = np.random.default_rng(seed)
    R = Rotation.random(n + 1, rng).as_matrix()
    t = rng.uniform(-0.5, 0.5, (n + 1, 3))
    prismatic = {
        "revolute": np.zeros(n, bool),
        "prismatic": np.ones(n, bool),
        "mixed": np.arange(n) % 3 == 1,
    }[kind]
    return Chain(R, t, prismatic)


def reference_jacobian(chain: Chain, q: np.ndarray) -> np.ndarray:
    """Jacobian by Pinocchio, one configuration."""
    *places, tip = (pin.SE3(R, t) for R, t in zip(chain.R, chain.t, strict=True))
    kinds = (pin.JointModelPZ() if slides else pin.JointModelRZ() for slides in chain.prismatic)
    model = serial(zip(kinds, places, strict=True), tip)
    how = q, model.getFrameId("tip"), pin.LOCAL_WORLD_ALIGNED
    return pin.computeFrameJacobian(model, model.createData(), *how).reshape(6, chain.n)


def with_values(rng: np.random.Generator, s: np.ndarray, m: int, n: int) -> np.ndarray:
    N, k = s.shape
    U = np.linalg.qr(rng.standard_normal((N, m, k)))[0]
    V = np.linalg.qr(rng.standard_normal((N, n, k)))[0]
    return (U * s[:, None, :]) @ V.transpose(0, 2, 1)


def matrices(m: int, n: int, N: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Regular, singular and nearly singular matrices: name, matrices, singular values.

    The values are LAPACK's, except for clusters of nearly equal ones, where LAPACK's can be wrong
    by 5e-15 themselves (checked with 40 digits): there the matrices are built from given values.
    """
    rng = np.random.default_rng(100 * m + n)
    k = min(m, n)
    A = rng.standard_normal((N, m, n))
    near = np.concatenate([rng.uniform(0.5, 1, (N, k - 1)), 10 ** rng.uniform(-20, 0, (N, 1))], 1)
    cases = {"regular": A, "zero": np.zeros((20, m, n))}
    for missing in range(1, min(4, k)):
        thin = rng.standard_normal((N, m, k - missing))
        cases[f"rank less {missing}"] = thin @ rng.standard_normal((N, k - missing, n))
    for row in (0, m // 2, m - 1):
        cases[f"zero row {row}"] = A * (np.arange(m) != row)[:, None]
    for column in (0, n // 2, n - 1):
        cases[f"zero column {column}"] = A * (np.arange(n) != column)
    cases["zero row and column"] = cases["zero row 0"] * (np.arange(n) != 0)
    cases["sparse"] = A * (rng.random((N, m, n)) < 0.4)
    cases["integers"] = np.round(A)
    cases["nearly singular"] = with_values(rng, near, m, n)
    cases["graded"] = with_values(rng, 10 ** rng.uniform(-18, 0, (N, k)), m, n)
    cases["graded rows"] = A * 10 ** rng.uniform(-12, 0, (N, m, 1))
    cases["graded columns"] = A * 10 ** rng.uniform(-12, 0, (N, 1, n))
    cases["two equal"] = with_values(rng, np.where(np.arange(k) < 2, 1.0, near), m, n)
    cases["diagonal"] = np.eye(m, n) * rng.integers(0, 3, (N, m, 1))
    cases["wild"] = A * 10 ** rng.uniform(-150, 150, (N, m, n))
    cases["huge"] = A * 1e300
    cases["tiny"] = A * 1e-300
    for name, matrix in cases.items():
        yield name, matrix, lapack(matrix)
    for spread in (0.0, 1e-14, 1e-12, 1e-8, 1e-4):
        s = -np.sort(-1 - spread * rng.standard_normal((N, k)), axis=1)
        yield f"spread {spread}", with_values(rng, s, m, n), s
    s = 10 ** rng.uniform(-17, 0, (N, k))
    s[::2, 1:3] = s[::2, :1] * (1 + 10 ** rng.uniform(-16, 0, s[::2, 1:3].shape))
    s = -np.sort(-s, axis=1)
    yield "pairs of any size", with_values(rng, s, m, n), s


def lapack(A: np.ndarray) -> np.ndarray:
    # With vectors, that is by divide and conquer: values only are wrong by up to 1.5e-14.
    return np.linalg.svd(A, full_matrices=False)[1]


def close(S: np.ndarray, expected: np.ndarray) -> bool:
    return bool((np.abs(S - expected) <= 5e-15 * expected[:, :1]).all())
