"""Processes or threads that work elsewhere, by Dask: a cluster of our own, or the workers of a scheduler."""

import os
import signal
import sys
from contextlib import suppress
from types import TracebackType

import dask
from distributed import Client, LocalCluster

from .errors import InputError

#: How long a scheduler may take to answer, and Dask to close, in seconds.
_ANSWER_S, _CLOSING_S = 10.0, 5.0

#: Whether worker processes are forked. Elsewhere a process that has loaded the system's libraries may not survive that.
_FORKED = sys.platform == "linux"

#: A worker that dies costs what it was doing, which is not tried again; one that works for long has not died. Nobody
#: looks at what its threads do every 10 ms: that takes the interpreter away from what is timed.
_SETTINGS = {
    "distributed.scheduler.allowed-failures": 0,
    "distributed.scheduler.worker-ttl": None,
    "distributed.worker.profile.enabled": False,
    # Worker processes are forked from one process that has imported what they need, which takes seconds, once for all.
    "distributed.worker.multiprocessing-method": "forkserver" if _FORKED else "spawn",
}

#: What that process imports: Dask, and all that a run needs.
_PRELOADED = ["distributed", f"{__package__}.run"]


class Cluster:
    """`count` workers of one thread each in `threads` or `processes`, or those of the scheduler at an address `where`.

    InputError names `key`, which chose the place, if nobody answers there.
    """

    def __init__(self, where: str, count: int, key: str) -> None:
        self._where = where
        self._own: LocalCluster | None = None
        try:
            if self.is_ours:
                with dask.config.set(_SETTINGS):
                    if _FORKED and where == "processes":
                        _start_fork_server()
                    self._own = LocalCluster(
                        n_workers=count,
                        threads_per_worker=1,
                        processes=where == "processes",
                        dashboard_address="127.0.0.1:0",
                        silence_logs=50,
                        memory_limit=0,
                    )
            self.client = Client(self._own or where, timeout=_ANSWER_S)
            self.workers = sorted(self.client.scheduler_info(n_workers=-1)["workers"])
        except OSError as error:
            raise InputError(f"{key}: no Dask scheduler answers at {where} ({error})") from None
        if not self.workers:
            self.client.close()
            raise InputError(f"{key}: the scheduler at {where} has no workers; start some: dask worker {where}")

    @property
    def is_ours(self) -> bool:
        """Whether the workers are on this machine, and end with us."""
        return self._where in ("threads", "processes")

    @property
    def count(self) -> int:
        """How many workers there are now."""
        return len(self.client.scheduler_info(n_workers=-1)["workers"])

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._own is not None and self._where == "processes":
            # Dask would wait for work that hangs. Nothing is lost: whoever leaves here has what the workers did.
            for nanny in self._own.workers.values():
                # Otherwise a worker that is gone is started again, and closing waits seconds for it.
                nanny.close_gracefully("the work is done")
                with suppress(ProcessLookupError, TypeError):
                    os.kill(nanny.pid, signal.SIGKILL)
        # A scheduler that does not come to an end in time, on a busy machine, is not to hide how the work ended.
        with suppress(TimeoutError, OSError):
            self.client.close(timeout=_CLOSING_S)
        if self._own is not None:
            with suppress(TimeoutError, OSError):
                self._own.close(timeout=_CLOSING_S)


def _start_fork_server() -> None:
    """Start the process that workers are forked from, unless it is there."""
    # Not every system has it.
    from multiprocessing import forkserver

    # What Dask sets for its workers counts when libraries are imported. Without PYTHONSAFEPATH, a file of a library's
    # name in the folder that we are in would be taken for that library.
    wanted = dask.config.get("distributed.nanny.pre-spawn-environ") | {"PYTHONSAFEPATH": 1}
    added = {key: str(value) for key, value in wanted.items() if value is not None and key not in os.environ}
    os.environ.update(added)
    try:
        forkserver.set_forkserver_preload(_PRELOADED)
        forkserver.ensure_running()
    finally:
        for key in added:
            del os.environ[key]
