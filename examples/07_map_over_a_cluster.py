"""A map of 100,000 configurations over a Dask cluster, and the same on threads: equal to the bit.

Needs pip install 'pinsing[cluster]'. For a cluster of many machines give Client its address.
"""

import numpy as np
from distributed import Client, LocalCluster

import pinsing

COUNT = 100_000


def main():
    arm = pinsing.load("panda")
    here = pinsing.sampling.sigma_map(arm, count=COUNT)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
        client.get_executor() as executor,
    ):
        there = pinsing.sampling.sigma_map(arm, count=COUNT, executor=executor, parallel=4)
    equal = all(np.array_equal(a.q, b.q) for a, b in zip(here.worst, there.worst, strict=True))
    print(f"{COUNT} configurations, near-singular: {there.near_singular}")
    print("the same on threads:", equal)


if __name__ == "__main__":
    main()
