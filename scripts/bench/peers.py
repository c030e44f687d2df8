"""What else computes Jacobians in Python, where it is installed: rows for ``batch.py --peers``.

Every peer is given the chain that Pinocchio read, and is checked against Pinocchio's Jacobians
before it is timed. Nothing is installed from here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np

from pinsing.measures import Chain

MODULES = {
    "jax": "jax",
    "roboticstoolbox-python": "roboticstoolbox",
    "pytorch-kinematics": "pytorch_kinematics",
}

Jacobians = Callable[[np.ndarray], np.ndarray]
Row = tuple[str, Callable[[np.ndarray], object], Jacobians, int]
"""Label, what is timed, its Jacobians as NumPy arrays, and by what the count is divided."""


def peers(chain: Chain, urdf: str, tip: str, values: bool) -> Iterator[Row]:
    """Rows of the peers that are installed."""
    kinds = {"jax": jax_row, "roboticstoolbox-python": toolbox_row, "pytorch-kinematics": torch_row}
    for package, rows in kinds.items():
        if package not in missing():
            yield rows(f"{package} {version(package)}", chain, urdf, tip, values)


def missing() -> list[str]:
    """Packages of the peers that are not installed."""
    return [package for package, module in MODULES.items() if find_spec(module) is None]


def jax_row(name: str, chain: Chain, urdf: str, tip: str, values: bool) -> Row:
    """A hand-written Jacobian of the flat chain, vectorised and compiled by XLA, in float64."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    R, t, slides = jnp.asarray(chain.R), jnp.asarray(chain.t), chain.prismatic

    def jacobian(q):
        turned, point = R[0], t[0]
        axes, points = [], []
        for i in range(chain.n):
            axes.append(turned[:, 2])
            points.append(point)
            if slides[i]:
                point = point + turned[:, 2] * q[i]
            else:
                c, s = jnp.cos(q[i]), jnp.sin(q[i])
                turned = turned @ jnp.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            point = point + turned @ t[i + 1]
            turned = turned @ R[i + 1]
        columns = [
            jnp.concatenate([z, jnp.zeros(3)])
            if slides[i]
            else jnp.concatenate([jnp.cross(z, point - p), z])
            for i, (z, p) in enumerate(zip(axes, points, strict=True))
        ]
        return jnp.stack(columns, axis=1)

    many = jax.jit(jax.vmap(jacobian))
    sigma = jax.jit(lambda Q: jnp.linalg.svd(jax.vmap(jacobian)(Q), compute_uv=False))
    run = sigma if values else many
    return (
        f"{name}, jit and vmap, its own threads",
        lambda Q: run(Q).block_until_ready(),
        lambda Q: np.asarray(many(Q)),
        1,
    )


def toolbox_row(name: str, chain: Chain, urdf: str, tip: str, values: bool) -> Row:
    """The toolbox's compiled jacob0 of an elementary transform sequence, one call each."""
    from roboticstoolbox import ET, ETS

    def constant(i: int) -> np.ndarray:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = chain.R[i], chain.t[i]
        return T

    parts = [ET.SE3(constant(0))]
    for i in range(chain.n):
        parts += [ET.tz() if chain.prismatic[i] else ET.Rz(), ET.SE3(constant(i + 1))]
    sequence = ETS(parts)

    def many(Q: np.ndarray) -> np.ndarray:
        return np.array([sequence.jacob0(q) for q in Q])

    def run(Q: np.ndarray) -> object:
        return np.linalg.svd(many(Q), compute_uv=False) if values else many(Q)

    return f"{name}, loop{' + one batched SVD' * values}", run, many, 20


def torch_row(name: str, chain: Chain, urdf: str, tip: str, values: bool) -> Row:
    """pytorch_kinematics on one thread (several get in each other's way), in float64."""
    import pytorch_kinematics as pk
    import torch

    torch.set_num_threads(1)

    with open(urdf, "rb") as file:
        serial = pk.build_serial_chain_from_urdf(file.read(), tip).to(dtype=torch.float64)

    def tensor(Q: np.ndarray) -> object:
        return torch.tensor(Q.tolist(), dtype=torch.float64)  # whatever NumPy torch was made for

    kept: dict[int, object] = {}

    def run(Q: np.ndarray) -> object:
        if id(Q) not in kept:
            kept[id(Q)] = tensor(Q)
        J = serial.jacobian(kept[id(Q)])
        return torch.linalg.svdvals(J) if values else J

    def many(Q: np.ndarray) -> np.ndarray:
        return np.array(serial.jacobian(tensor(Q)).tolist())

    return f"{name}, torch {torch.__version__}, 1 thread", run, many, 5
