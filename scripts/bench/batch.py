"""Time the batch engine against a Pinocchio loop with NumPy, and peers, all rows in one run.

    python scripts/bench/batch.py [--count 50000] [--rounds 7] [--peers]

Each row is the best of several rounds, and the rows take turns within a round, so that a change of
clock rate or another program on the machine touches all of them alike. Read the ratios: to the
"batched" row, a Pinocchio loop into one array and one np.linalg.svd over it, of the same arm. With
--peers, those packages that are installed take part; nothing is installed.
"""

from __future__ import annotations

import argparse
import functools
import platform
import time
from collections.abc import Callable
from importlib.metadata import distribution

import numpy as np
import pinocchio as pin
from peers import missing, peers

from pinsing._batch import engine
from pinsing.kinematics.jacobian import fixed_batch
from pinsing.robot.arm import Arm
from pinsing.robot.load import load
from pinsing.robot.nominal import flatten
from pinsing.sampling.maps import MapJob, compute_map_chunk, plan_map

ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
ARMS = {
    "UR5": ("ur_description/urdf/ur5_robot.urdf", "tool0"),
    "Panda": ("panda_description/urdf/panda.urdf", "panda_hand_tcp"),
}
LOOP = "Pinocchio loop into one array"
REFERENCE = "Pinocchio loop + one batched np.linalg.svd"
PEER_AGREEMENT = 1e-6  # pytorch_kinematics reads a model in single precision

Rows = dict[str, tuple[Callable[[], object], int]]


def urdf_of(name: str) -> str:
    return str(distribution("example-robot-data").locate_file(f"{ROBOTS}/{ARMS[name][0]}"))


def arm_named(name: str) -> Arm:
    return load(pin.buildModelFromUrdf(urdf_of(name)), tip=ARMS[name][1])


def pinocchio_loop(arm: Arm, data: pin.Data, Q: np.ndarray) -> np.ndarray:
    J = np.empty((len(Q), 6, arm.n))
    model, tip, frame = arm.model, arm.tip_id, pin.LOCAL_WORLD_ALIGNED
    for i, q in enumerate(Q):
        J[i] = pin.computeFrameJacobian(model, data, q, tip, frame)
    return J


def each_by_itself(arm: Arm, data: pin.Data, Q: np.ndarray, values: bool) -> None:
    model, tip, frame = arm.model, arm.tip_id, pin.LOCAL_WORLD_ALIGNED
    for q in Q:
        J = pin.computeFrameJacobian(model, data, q, tip, frame)
        if values:
            np.linalg.svd(J, compute_uv=False)


def rows_of(name: str, count: int, values: bool, with_peers: bool) -> Rows:
    """Name the rows: what to run and how many configurations it treats."""
    arm = arm_named(name)
    flat = flatten(arm)
    data = arm.model.createData()
    Q = np.random.default_rng(0).uniform(-3.0, 3.0, (count, arm.n))
    few = Q[: max(1, count // 10)]
    expected = pinocchio_loop(arm, data, few)

    worst = np.abs(engine.jacobians(flat, few) - expected).max()
    if worst > 1e-12:
        raise SystemExit(f"{name}: the engine differs from Pinocchio by {worst:.1e}")

    def batched() -> None:
        J = pinocchio_loop(arm, data, few)
        if values:
            np.linalg.svd(J, compute_uv=False)

    rows: Rows = {
        REFERENCE if values else LOOP: (batched, len(few)),
        "each configuration by itself": (lambda: each_by_itself(arm, data, few, values), len(few)),
    }
    if with_peers:
        for label, run, jacobians, divisor in peers(flat, urdf_of(name), arm.tip, values):
            some = Q[: max(100, count // divisor)]
            worst = np.abs(jacobians(few[:100]) - expected[:100]).max()
            if worst > PEER_AGREEMENT:
                raise SystemExit(f"{name}: {label} differs from Pinocchio by {worst:.1e}")
            run(some)  # compiled, and warm
            rows[label] = (functools.partial(run, some), len(some))
    run_engine = engine.singular_values if values else engine.jacobians
    for isa in engine.isa_names():
        for threads in (1, 2):
            task = functools.partial(run_engine, flat, Q, threads=threads, isa=isa)
            rows[f"pinsing, {isa}, {threads} thread{'s' * (threads > 1)}"] = (task, count)
    if values:
        plan = plan_map(arm, count=count, joints=arm.joints)
        job = MapJob(plan, fixed_batch(arm))
        rows["pinsing, a Sobol map of all joints, 1 thread"] = (
            lambda: compute_map_chunk(job, 0),
            min(count, plan.chunk),
        )
    return rows


def measure(rows: Rows, rounds: int) -> dict[str, float]:
    """Best time per configuration of each row [us]."""
    best = dict.fromkeys(rows, np.inf)
    for _ in range(rounds):
        for name, (task, count) in rows.items():
            start = time.perf_counter()
            task()
            best[name] = min(best[name], (time.perf_counter() - start) / count * 1e6)
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=50_000, help="configurations of an engine row")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--peers", action="store_true", help="also what else is installed")
    options = parser.parse_args()
    if not engine.available():
        raise SystemExit(engine.unavailable_reason())
    print(f"{platform.machine()}, {engine.cpu_count()} processors; ", end="")
    print(f"Python {platform.python_version()}, Pinocchio {pin.__version__}, ", end="")
    print(f"NumPy {np.__version__}")
    print(f"instruction sets here: {', '.join(engine.isa_names())} (the last is the default)")
    if options.peers and missing():
        print(f"not installed, so not measured: {', '.join(missing())}")
    print()
    print(f"{'arm':6} {'result':12} {'row':56} {'us/config':>10} {'x faster':>9}")
    for name in ARMS:
        for values in (False, True):
            best = measure(rows_of(name, options.count, values, options.peers), options.rounds)
            reference = best[REFERENCE if values else LOOP]
            for row, us in best.items():
                result = "J and sigma" if values else "J alone"
                print(f"{name:6} {result:12} {row:56} {us:10.3f} {reference / us:9.2f}")
            print(flush=True)


if __name__ == "__main__":
    main()
