"""Where the points of a study are run, each once, and their results are kept: `points/<hash>` in the study's folder."""

import logging
import os
import shutil
import time
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from distributed import Future, wait
from distributed.scheduler import KilledWorker
from rich.console import Console

from ..orchestrator.cluster import Cluster
from ..orchestrator.errors import InputError, Interrupted, RunError
from ..orchestrator.progress import Progress
from ..orchestrator.results.lock import FolderLock
from ..orchestrator.results.origin import program
from ..orchestrator.stopping import StopRequest
from .execution import Job, execute, time_once
from .point import Point
from .trial import CRASHED, Trial, read_trial

_LOG = logging.getLogger(__name__)

_POINTS = "points"

#: What workers need for a while only.
_SCRATCH = "scratch"

#: Seconds that the repetitions of short runs may take in all, and the part of all other runs by which they may exceed
#: that: a study of many short points is to be done soon.
_REPEATS_S, _REPEATS = 10.0, 0.05

#: How often we look whether somebody wants us to stop, in seconds.
_LOOK_S = 0.2

#: How long a worker that died may take to be started again, in seconds.
_PATIENCE_S = 60.0


class Bench:
    """While entered, the folder is ours; InputError if another process has it.

    Points are run one after the other, alone on their cores, in a process of their own; with `workers` so many at the
    same time, or by the workers of the Dask scheduler at `scheduler`, who have to see the same files.
    """

    def __init__(
        self, folder: Path, console: Console | None = None, workers: int | None = None, scheduler: str | None = None
    ) -> None:
        self.folder = folder
        self._console = console or Console(quiet=True)
        self._workers = workers
        self._scheduler = scheduler
        self._stack = ExitStack()
        self._cluster: Cluster | None = None
        self._repeats_s = _REPEATS_S
        self._stop = StopRequest()
        self._seen_alive = time.monotonic()

    @property
    def is_alone(self) -> bool:
        """Whether points have their cores to themselves, so that the wall clock tells what they cost."""
        return self._scheduler is None and (self._workers or 1) == 1

    def __enter__(self) -> "Bench":
        self._stack.callback(FolderLock(self.folder).release)
        # One that was killed may have left something.
        self._clear()
        self._stack.callback(self._clear)
        self._stack.enter_context(self._stop)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def known(self, point: Point) -> Trial | None:
        """How it went with a point, if it was run before."""
        return read_trial(self._place(point))

    def run(self, points: Iterable[Point], title: str) -> list[Trial]:
        """Run whatever of `points` was not run before; how it went with each. `title` is for the progress bar.

        What is finished stays, whatever ends this: Interrupted when a signal asked for it, RunError when all workers
        are gone and none comes back.
        """
        wanted = list(points)
        unique = {point.key: point for point in wanted}
        trials = {key: trial for key, point in unique.items() if (trial := self.known(point)) is not None}
        missing = [point for key, point in unique.items() if key not in trials]
        if missing:
            self._run(missing, len(unique), title, trials)
        return [trials[point.key] for point in wanted]

    @property
    def places(self) -> int:
        """How many points run at the same time."""
        return (self._workers or 1) if self._scheduler is None else len(self._started().workers)

    def time_in_turn(self, points: Sequence[Point], runs: int, title: str) -> list[Trial]:
        """Run points again that are done, one after the other and round by round, until each has so many runs.

        What the machine does meanwhile meets all of them alike. The trials with the costs of all their runs.
        """
        trials = {point.key: trial for point, trial in zip(points, self.run(points, title), strict=True)}
        unique = {point.key: point for point in points}
        missing = {key: max(runs - len(trials[key].costs), 0) for key in unique if trials[key].is_done}
        total, done = sum(missing.values()), 0
        with Progress(self._console, title, total) as bar:
            while any(missing.values()):
                for key in [key for key, count in missing.items() if count]:
                    bar.update(done, f"{done}/{total}", str(unique[key]))
                    self._time(unique[key], trials)
                    missing[key] -= 1
                    done += 1
            bar.update(done, f"{done}/{total}")
        return [trials[point.key] for point in points]

    # --- inside -------------------------------------------------------------------------------------------------------

    def _clear(self) -> None:
        shutil.rmtree(self.folder / _SCRATCH, ignore_errors=True)

    def _place(self, point: Point) -> Path:
        return (self.folder / _POINTS / point.key).absolute()

    def _run(self, points: Sequence[Point], count: int, title: str, trials: dict[str, Trial]) -> None:
        queue, running = deque(points), dict[Future, Point]()
        done, now = count - len(points), ""
        with Progress(self._console, title, count) as bar:
            bar.update(done, f"{done}/{count}")
            cluster = self._started()
            while queue or running:
                while queue and len(running) < len(cluster.workers):
                    point = queue.popleft()
                    now = str(point)
                    bar.update(done, f"{done}/{count}", now)
                    running[cluster.client.submit(execute, self._job(point), pure=False)] = point
                finished = _finished(running)
                self._check_alive(cluster, bool(finished))
                for future in finished:
                    point = running.pop(future)
                    trials[point.key] = trial = self._outcome(future, point)
                    self._account(trial)
                    done += 1
                    bar.update(done, f"{done}/{count}", now)
                    _LOG.info(
                        "%s: %s of %s, %s: %s", title, done, count, point, trial.reason or f"{trial.wall_s:.2f} s"
                    )
                if self._stop.signal is not None:
                    raise Interrupted(self._stop.signal)

    def _time(self, point: Point, trials: dict[str, Trial]) -> None:
        future = self._started().client.submit(time_once, self._job(point), pure=False)
        while not _finished([future]):
            if self._stop.signal is not None:
                raise Interrupted(self._stop.signal)
        try:
            cost = future.result()
        except KilledWorker:
            raise RunError(f"the process that measured {point} again died; run the same command again") from None
        finally:
            future.release()
        trials[point.key] = trial = replace(trials[point.key], costs=(*trials[point.key].costs, cost))
        trial.write()

    def _job(self, point: Point) -> Job:
        scratch = (self.folder / _SCRATCH).absolute()
        return Job(point.scenario, point.base.absolute(), self._place(point), scratch, self._repeats_s, self.is_alone)

    def _outcome(self, future: Future, point: Point) -> Trial:
        try:
            trial: Trial = future.result()
        except KilledWorker:
            return Trial(
                self._place(point),
                CRASHED,
                "the process that ran it died, perhaps in the code of an FMU; run that scenario alone to learn more",
            )
        finally:
            future.release()
        return trial

    def _account(self, trial: Trial) -> None:
        walls = [cost.wall_s for cost in trial.costs]
        self._repeats_s += _REPEATS * sum(walls[:1]) - sum(walls[1:])

    def _check_alive(self, cluster: Cluster, works: bool) -> None:
        """RunError where there has been no worker for long: nothing would ever be finished."""
        now = time.monotonic()
        if works or cluster.count:
            self._seen_alive = now
        elif now - self._seen_alive > _PATIENCE_S:
            raise RunError(
                f"there has been no worker for {_PATIENCE_S:g} s; what is finished is in {self.folder}: start workers "
                "and run the same command again to continue"
            )

    def _started(self) -> Cluster:
        if self._cluster is None:
            if self._scheduler is None:
                cluster = Cluster("processes", self._workers or 1, "--workers")
            else:
                cluster = Cluster(self._scheduler, 0, "--scheduler")
            self._cluster = self._stack.enter_context(cluster)
            if self._scheduler is not None:
                self._check(cluster)
        return self._cluster

    def _check(self, cluster: Cluster) -> None:
        """InputError unless all workers have this program and see this folder."""
        mark = self.folder.absolute() / f".seen-by-{os.getpid()}-{time.monotonic_ns()}"
        mark.touch()
        try:
            answers = cluster.client.run(_look, str(mark))
        except ImportError as error:
            raise InputError(f"--scheduler: the workers lack this project ({error}); install it there") from None
        finally:
            mark.unlink()
        for worker, (known, sees) in answers.items():
            if known != program():
                raise InputError(
                    f"--scheduler: worker {worker} has another version of this program; install the same one there"
                )
            if not sees:
                raise InputError(
                    f"--scheduler: worker {worker} does not see the folder {self.folder.absolute()}; choose an "
                    "--output on a file system that all workers share"
                )


def _look(mark: str) -> tuple[str, bool]:
    """On a worker: which program it has, and whether it sees a file of ours."""
    return program(), Path(mark).exists()


def _finished(running: Iterable[Future]) -> list[Future]:
    futures = list(running)
    try:
        return list(wait(futures, timeout=_LOOK_S, return_when="FIRST_COMPLETED").done)
    except TimeoutError:
        return []
