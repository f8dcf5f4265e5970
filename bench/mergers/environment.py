"""The environment of calls: linear algebra on one thread; and of the programs they start: the user's own."""

import os

_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_ADDED = "MAPMERGE_BENCH_ADDED"


def server_environment() -> dict[str, str]:
    """This process's environment, with one thread for linear algebra unless the user has said otherwise.

    Threads that wait for each other on a busy machine burn processor time and change no result.
    """
    added = [name for name in _THREADS if name not in os.environ]
    return dict(os.environ) | dict.fromkeys(added, "1") | {_ADDED: ",".join(added)}


def original_environment() -> dict[str, str]:
    """This process's environment without what `server_environment` added to it."""
    added = os.environ.get(_ADDED, "").split(",")
    return {name: value for name, value in os.environ.items() if name not in (*added, _ADDED)}
