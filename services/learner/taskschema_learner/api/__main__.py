"""`python -m taskschema_learner.api`: the API in a process of its own."""

import os
import sys


def _run() -> int:
    # Before numpy is imported: acting is a few small products, threads would only take cores from training.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ[variable] = "1"
    from taskschema_learner.api.command import main

    return main()


if __name__ == "__main__":
    sys.exit(_run())
