"""If these fail, units that work elsewhere compute something else, work one after the other, or take the run down."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.cluster import Cluster
from cardiac_cosim.orchestrator.errors import InputError, ParticipantLost, RunError
from cardiac_cosim.orchestrator.participants.participant import Participant
from cardiac_cosim.orchestrator.participants.recipe import Recipe
from cardiac_cosim.orchestrator.participants.workers import Workers, _Host
from cardiac_cosim.orchestrator.results.recording import Recording
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mesh import Mesh
from distributed import Nanny
from threadpoolctl import threadpool_info, threadpool_limits


def _series(scenario: Path, out: Path, *sets: str) -> bytes:
    run_scenario(load_scenario(scenario, sets), scenario.parent, out, fmu_dir=scenario.parent)
    return (out / "timeseries.csv").read_bytes()


@pytest.mark.parametrize("where", ["threads", "processes"])
@pytest.mark.parametrize("participants", ["native", "fmu"])
def test_workers_give_the_same_bits(where: str, participants: str, small_scenario: Path, tmp_path: Path) -> None:
    common = ("coupling.scheme=jacobi", f"run.participants={participants}", "run.stop_ms=5")
    alone = _series(small_scenario, tmp_path / "alone", *common)
    assert _series(small_scenario, tmp_path / "workers", *common, f"run.workers={where}") == alone


def test_no_unit_starts_threads_of_its_own(
    small_scenario: Path, small_heart: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    class Watches(Recording):
        def accept(self, step: Any, exchange: Any) -> None:
            seen.append(_threads())
            super().accept(step, exchange)

    monkeypatch.setattr("cardiac_cosim.orchestrator.results.folder.Recording", Watches)
    with threadpool_limits(limits=2):
        _series(small_scenario, tmp_path / "out", "run.stop_ms=2")
        assert seen == [{1}] * 3
        # What a run finds it leaves.
        assert _threads() == {2}
        _Host(Recipe("a", unit="active_stress", mesh=small_heart), apart=True)
        assert _threads() == {1}


def _threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_iterated_and_ramped_coupling_works_in_workers(small_scenario: Path, tmp_path: Path) -> None:
    common = (
        "coupling={scheme: jacobi, step_ms: 2.5, interpolation: linear, extrapolation: 1, "
        "iterate: {acceleration: anderson, converge: {stretch: {relative: 1e-4}}}}",
        "run.stop_ms=5",
    )
    alone = _series(small_scenario, tmp_path / "alone", *common)
    assert _series(small_scenario, tmp_path / "workers", *common, "run.workers=processes") == alone


@pytest.fixture
def scheduler() -> Iterator[str]:
    """A scheduler with one worker, as on another machine."""
    from distributed import LocalCluster

    with LocalCluster(n_workers=1, threads_per_worker=4, processes=True, dashboard_address=None) as cluster:
        yield cluster.scheduler_address


def test_units_work_under_a_scheduler_elsewhere(scheduler: str, small_scenario: Path, tmp_path: Path) -> None:
    common = ("coupling.scheme=jacobi", "run.participants=fmu", "run.stop_ms=5")
    alone = _series(small_scenario, tmp_path / "alone", *common)
    assert _series(small_scenario, tmp_path / "workers", *common, f"run.workers={scheduler}") == alone


def test_a_scheduler_that_does_not_answer_is_the_persons_to_mend(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cardiac_cosim.orchestrator.cluster._ANSWER_S", 1.0)
    with pytest.raises(InputError, match=r"run\.workers: no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        _series(small_scenario, tmp_path / "out", "run.workers=tcp://127.0.0.1:9")


@pytest.fixture
def asleep() -> type[Recipe]:
    """Recipe of a participant that takes time. Defined in here, it is sent to processes that have no such module."""

    class Sleeper:
        """Takes a second for a step, and says where it took it."""

        def __init__(self, seconds: float = 1.0) -> None:
            self._seconds = seconds
            self.inputs: dict[str, Any] = {}
            self.outputs: dict[str, Any] = {}
            self.observed: dict[str, Any] = {}
            self.abilities = None

        def start(self, begin: float, size: float) -> Any:
            time.sleep(self._seconds)
            return lambda: None

        def get(self, name: str) -> Any:
            return np.array([os.getpid(), threading.get_ident()], float)

        def die(self) -> None:
            os.kill(os.getpid(), signal.SIGKILL)

        def close(self) -> None:
            pass

    class Asleep(Recipe):
        def make(self) -> Participant:
            return Sleeper(float(self.parameters.get("seconds", 1.0)))  # type: ignore[return-value]

    return Asleep


@pytest.mark.parametrize("where", ["threads", "processes"])
def test_units_step_at_the_same_time(where: str, asleep: type[Recipe]) -> None:
    with Workers(where, 2, None) as workers:
        units = [workers.make(asleep(name)) for name in "ab"]
        places = {tuple(unit.get("place").tolist()) for unit in units}
        assert len(places) == 2
        assert all((pid == os.getpid()) == (where == "threads") for pid, _ in places)
        begin = time.perf_counter()
        waits = [unit.start(0.0, 1.0) for unit in units]
        seconds = [wait() for wait in waits]
        # Not a measurement of speed: one after the other they would take two seconds at the least.
        assert time.perf_counter() - begin < 1.9
        assert all(0.99 < taken.wall_s < 1.9 for taken in seconds if taken is not None)


def test_a_unit_that_hangs_is_given_up(asleep: type[Recipe]) -> None:
    with Workers("processes", 1, 1.0) as workers:
        unit = workers.make(asleep("sleeper", {"seconds": 600.0}))
        wait = unit.start(0.0, 1.0)
        with pytest.raises(ParticipantLost, match=r"did not return within 1 s \(run\.unit_time_limit_s\)"):
            wait()


def test_a_unit_that_dies_takes_only_its_process_along(asleep: type[Recipe]) -> None:
    with Workers("processes", 2, None) as workers:
        doomed, other = workers.make(asleep("doomed")), workers.make(asleep("other", {"seconds": 0.0}))
        pid = int(doomed.get("place")[0])
        wait = doomed.start(0.0, 1.0)
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(ParticipantLost, match="its process ended unexpectedly"):
            wait()
        other.start(0.0, 1.0)()


def test_workers_whose_work_is_done_are_not_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    async def start(nanny: Nanny) -> None:
        started.append(nanny)

    with Cluster("processes", 1, "run.workers") as cluster:
        assert cluster.client.submit(os.getpid).result(timeout=60) != os.getpid()
        monkeypatch.setattr(Nanny, "instantiate", start)
        close = cluster.client.close

        def slowly(**options: Any) -> None:
            # As on a busy machine: Dask learns that the worker is gone before it is told to come to an end.
            time.sleep(0.5)
            close(**options)

        monkeypatch.setattr(cluster.client, "close", slowly)
    assert not started


@pytest.mark.skipif(sys.platform != "linux", reason="worker processes are forked on Linux only")
def test_a_file_that_lies_about_is_not_taken_for_a_library(tmp_path: Path) -> None:
    (tmp_path / "colorsys.py").write_text("open('taken', 'w').close()")
    text = (
        "import multiprocessing; from cardiac_cosim.orchestrator import cluster\n"
        "cluster._PRELOADED = ['colorsys']\n"
        "cluster._start_fork_server()\n"
        # The server has imported what it was to before it forks.
        "process = multiprocessing.get_context('forkserver').Process(target=print, args=('forked',))\n"
        "process.start(); process.join()\n"
    )
    done = subprocess.run([sys.executable, "-c", text], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.stdout, done.returncode) == ("forked\n", 0), done.stderr
    assert not (tmp_path / "taken").exists()


def test_when_a_worker_is_killed_the_results_so_far_are_readable_and_the_run_can_go_on(
    small_scenario: Path, tmp_path: Path
) -> None:
    common = ("run.checkpoint_every=3", "run.stop_ms=40", "run.participants=fmu")
    whole = _series(small_scenario, tmp_path / "whole", *common)
    out, sets = tmp_path / "killed", (*common, "run.workers=processes")
    command = [sys.executable, "-m", "cardiac_cosim.cli", "run", str(small_scenario), "--no-figures", "--no-report"]
    command += ["--output", str(out), *(part for text in sets for part in ("--set", text))]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        begin = time.monotonic()
        while not (out / "coupling.csv").is_file() or (out / "coupling.csv").read_text().count("\n") < 6:
            assert time.monotonic() - begin < 120.0, process.communicate()
            time.sleep(0.02)
        # The one that has loaded the mechanics' FMU; the fibres' is not needed any more by now.
        (worker,) = [pid for pid in _descendants(process.pid) if "/mechanics.so" in _mapped(pid)]
        os.kill(worker, signal.SIGKILL)
        _, message = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 3, message
    assert "its process ended unexpectedly" in message
    assert json.loads((out / "summary.json").read_text())["status"] == "failed"
    series = (out / "timeseries.csv").read_bytes()
    assert whole.startswith(series)
    outcome = run_scenario(load_scenario(small_scenario, sets), tmp_path, out, resume=True)
    assert outcome.summary["status"] == "done"
    assert (out / "timeseries.csv").read_bytes() == whole


def _descendants(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        for child in map(int, (task / "children").read_text().split()):
            found += [child, *_descendants(child)]
    return found


def _mapped(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return ""


def test_the_failure_of_a_unit_elsewhere_is_told_like_one_here(small_scenario: Path, tmp_path: Path) -> None:
    sets = ("units.active_stress.parameters.delay_function=as_printed", "run.workers=processes")
    with pytest.raises(RunError, match=r"unit 'active_stress' failed .* the delay function gives the rate"):
        _series(small_scenario, tmp_path / "out", *sets)
    with pytest.raises(InputError, match="has no parameter"):
        _series(small_scenario, tmp_path / "out", "units.mechanics.parameters.nothing=1", "run.workers=processes")
