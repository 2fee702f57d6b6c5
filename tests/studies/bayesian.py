"""Bayesian optimisation by scikit-optimize as an external search; host/src/search/external.rs has the lines it speaks.

    pip install -r tests/studies/requirements.txt

A Gaussian process with a noise term, the start and nine points at random, then the point of the highest upper confidence
bound: expected improvement would chase the luckiest episode. What it recommends is the best expected reward of the whole cube.
"""

import json
import os
import sys
import warnings

# One thread: studies already run one world a core.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402
from skopt import Optimizer, expected_minimum  # noqa: E402

warnings.filterwarnings("ignore")


def inside(point):
    return [float(np.clip(u, -1.0, 1.0)) for u in point]


def main():
    begin = json.loads(sys.stdin.readline())
    start = begin["start"]
    search = Optimizer(
        [(-1.0, 1.0)] * len(start),
        base_estimator="GP",
        acq_func="LCB",
        n_initial_points=min(10, begin["episodes"]),
        random_state=begin["seed"] % 2**32,
    )
    # The start first: what is not better than it is not worth keeping.
    point, result = start, None
    print(json.dumps(point), flush=True)
    for line in sys.stdin:
        told = json.loads(line)
        if "reward" in told:
            result = search.tell(point, -told["reward"])
            point = inside(search.ask())
            answer = point
        elif result is not None and result.models:
            answer = inside(expected_minimum(result, random_state=begin["seed"] % 2**32)[0])
        else:
            answer = start
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
