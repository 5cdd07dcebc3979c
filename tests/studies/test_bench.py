"""If these fail, a study that is interrupted loses points or runs them twice, or one bad point ends all of them."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.errors import InputError, RunError
from cardiac_cosim.orchestrator.results.lock import FolderLock
from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.plan import plan_study

_COMMAND = [sys.executable, "-m", "cardiac_cosim.cli", "chart"]


def _trials(out: Path) -> dict[str, int]:
    """The finished points of a study by folder, and when they were finished."""
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("points/*/trial.json")}


def test_every_point_is_run_once(study: Path, tmp_path: Path, charted: Callable[..., Any]) -> None:
    first = charted(study)
    before = _trials(tmp_path / "out")
    # Linear inputs of 1 ms and all others: seven points and the reference.
    assert len(before) == 8
    second = charted(study)
    assert _trials(tmp_path / "out") == before
    assert [row.errors for row in second.rows] == [row.errors for row in first.rows]
    assert [row.cost(second.cost) for row in second.rows] == [row.cost(first.cost) for row in first.rows]
    # What is new in a study is run beside what is there.
    study.write_text(study.read_text().replace("[1, 2, 4]", "[1, 2, 4, 5]"))
    charted(study)
    after = _trials(tmp_path / "out")
    assert {name: after[name] for name in before} == before
    assert len(after) == 9


@pytest.mark.long
def test_killed_at_random_moments_it_goes_on_where_it_was(study: Path, tmp_path: Path) -> None:
    study.write_text(study.read_text().replace("[0.5, 1, 2, 4]", "[0.5, 0.8, 1, 1.25, 2, 2.5, 4, 5, 10, 20]"))
    out = tmp_path / "killed"
    chance = random.Random(7)
    deaths, seen = 0, dict[str, int]()
    for _ in range(12):
        process = subprocess.Popen([*_COMMAND, str(study), "--output", str(out)], stderr=subprocess.PIPE, text=True)
        begin, before = time.monotonic(), len(_trials(out))
        while process.poll() is None and len(_trials(out)) == before and time.monotonic() - begin < 60.0:
            time.sleep(0.01)
        time.sleep(chance.uniform(0.0, 0.5))
        process.kill()
        process.communicate()
        deaths += process.returncode == -signal.SIGKILL
        now = _trials(out)
        # No finished point is lost, and none is run again.
        assert {name: now.get(name) for name in seen} == seen
        seen = now
        if process.returncode == 0 or deaths == 3:
            break
    assert deaths >= 2
    done = subprocess.run([*_COMMAND, str(study), "--output", str(out)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    now = _trials(out)
    assert {name: now[name] for name in seen} == seen
    assert len(now) == 14
    assert "13 of 13 points are done" in done.stdout
    undisturbed = tmp_path / "whole"
    subprocess.run([*_COMMAND, str(study), "--output", str(undisturbed)], check=True, capture_output=True, timeout=120)
    assert _errors(out) == _errors(undisturbed)


def _errors(out: Path) -> list[list[str]]:
    lines = [line.split(",") for line in (out / "chart.csv").read_text().splitlines()]
    kept = [place for place, name in enumerate(lines[0]) if name.startswith(("line", "error_", "solves_", "sweeps"))]
    return [[line[place] for place in kept] for line in lines]


def test_stopped_by_a_signal_it_says_how_to_go_on(study: Path, tmp_path: Path) -> None:
    scenario = tmp_path / "small_cell.yaml"
    scenario.write_text(scenario.read_text().replace("stop_ms: 40,", "stop_ms: 4000,"))
    process = subprocess.Popen(
        [*_COMMAND, str(study), "--output", str(tmp_path / "out")],
        stderr=subprocess.PIPE,
        text=True,
        # Whoever runs the tests in the background lets them ignore it.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    begin = time.monotonic()
    while not (tmp_path / "out" / "points").is_dir() and time.monotonic() - begin < 60.0:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGINT
    assert told.count("\n") == 1
    assert "the same command continues from there" in told


def test_a_folder_belongs_to_one_study_at_a_time(study: Path, tmp_path: Path, cosim: Callable[..., Any]) -> None:
    out = tmp_path / "out"
    text = (
        "import sys, pathlib; from cardiac_cosim.orchestrator.results.lock import FolderLock\n"
        f"lock = FolderLock(pathlib.Path({str(out)!r}))\n"
        "print('mine', flush=True); sys.stdin.read()"
    )
    other = subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert other.stdout is not None
        assert other.stdout.readline() == b"mine\n"
        refused = cosim("chart", study, "--output", out)
    finally:
        other.communicate(timeout=60)
    assert refused.code == 2
    assert f"in use by process {other.pid}" in refused.err
    # Its end gives the folder free.
    with Bench(out), pytest.raises(InputError, match=f"in use by process {os.getpid()}"):
        FolderLock(out)


def test_a_point_that_fails_is_a_point_with_a_reason(study: Path, charted: Callable[..., Any]) -> None:
    # Few others will do.
    study.write_text(study.read_text().replace("[0.5, 1, 2, 4]", "[2, 4]").replace("[1, 2, 4]", "[4]"))
    settings = "{max_iterations: 1, converge: {stretch: {relative: 1.0e-12}}}"
    study.write_text(f"{study.read_text()}  - name: iterated\n    vary: {{coupling.iterate: [{settings}]}}\n")
    # Without a loop there would be nothing to iterate.
    text = (study.parent / "small_cell.yaml").read_text()
    assert "stretch_conductance" not in text
    chart = charted(study)
    assert [row.status for row in chart.rows] == ["done"] * 3 + ["failed"]
    assert "no convergence in 1 sweeps" in chart.rows[-1].reason
    assert not chart.rows[-1].front


def test_a_process_that_dies_costs_its_point_only(
    tmp_path: Path, bodies: dict[str, Path], charted: Callable[..., Any]
) -> None:
    (tmp_path / "masses.yaml").write_text(_MASSES.replace("WHOLE", str(bodies["whole"])))
    path = tmp_path / "crash.yaml"
    path.write_text(_CRASH.replace("WHOLE", str(bodies["whole"])).replace("BREAKS", str(bodies["breaks"])))
    chart = charted(path)
    assert [row.status for row in chart.rows] == ["done", "crashed", "done"]
    assert "died" in chart.rows[1].reason
    # It left no result, so that it is tried again; the others are not.
    before = _trials(tmp_path / "out")
    assert [row.status for row in charted(path).rows] == ["done", "crashed", "done"]
    assert _trials(tmp_path / "out") == before


_MASSES = """\
name: masses
units:
  first: {fmu: WHOLE, parameters: {k: 10, c: 0.2}, start: {x: 1}}
  second: {fmu: WHOLE, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5}, start: {x: 0.5}}
connections: [first.x -> second.x_in, first.v -> second.v_in, second.F -> first.F_in]
coupling: {scheme: jacobi, step_ms: 10}
run: {stop_ms: 200}
output: {every_ms: 200}
"""

_CRASH = """\
name: crash
scenario: masses.yaml
reference: {coupling.step_ms: 1}
lines:
  - name: sound
    vary: {units.first.fmu: [WHOLE, BREAKS]}
  - name: longer
    set: {coupling.step_ms: 20}
"""


def test_several_at_the_same_time_come_to_the_same_and_are_compared_by_processor_seconds(
    study: Path, steps: Any, charted: Callable[..., Any]
) -> None:
    one, many = steps.chart, charted(study, workers=2)
    assert [row.errors for row in many.rows] == [row.errors for row in one.rows]
    assert (one.cost, many.cost) == ("wall_s", "cpu_s")
    assert any("several points ran at the same time" in note for note in many.notes)


def test_the_workers_of_a_scheduler_do_it_as_well(
    study: Path, steps: Any, tmp_path: Path, charted: Callable[..., Any]
) -> None:
    address = tmp_path / "address"
    process = _cluster_elsewhere(address, processes=False)
    try:
        there = charted(study, scheduler=address.read_text())
    finally:
        process.communicate(timeout=60)
    assert [row.errors for row in there.rows] == [row.errors for row in steps.chart.rows]


def test_a_scheduler_that_is_not_there_is_told(
    study: Path, charted: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cardiac_cosim.orchestrator.cluster._ANSWER_S", 1.0)
    with pytest.raises(InputError, match=r"--scheduler: no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        charted(study, scheduler="tcp://127.0.0.1:9")


def test_what_a_point_leaves_is_what_a_run_leaves(steps: Any) -> None:
    point = plan_study(steps.study).lines["held"][1].point
    assert point is not None
    folder = steps.output / "points" / point.key
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["scenario"]["coupling"]["step_ms"] == 1
    assert len((folder / "timeseries.csv").read_text().splitlines()) == 42
    assert not (folder / "checkpoint.h5").exists()


def test_a_study_whose_workers_are_all_gone_comes_to_an_end(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cardiac_cosim.studies.bench._PATIENCE_S", 1.0)
    text = (tmp_path / "small_cell.yaml").read_text()
    (tmp_path / "small_cell.yaml").write_text(text.replace("stop_ms: 40", "stop_ms: 400000"))
    address = tmp_path / "address"
    process = _cluster_elsewhere(address)
    points = plan_study(study).points[-1:]
    with Bench(tmp_path / "out", scheduler=address.read_text()) as bench:
        # The worker goes as soon as it has begun.
        watcher = threading.Thread(target=_kill_worker, args=(process, tmp_path / "out"))
        watcher.start()
        with pytest.raises(RunError, match="there has been no worker for 1 s"):
            bench.run(points, "study")
        watcher.join()
    process.communicate(timeout=60)


def _cluster_elsewhere(address: Path, processes: bool = True) -> "subprocess.Popen[bytes]":
    """A cluster of one worker in another process, which ends when its input does; 'kill' there lets the worker die.

    That process works itself where its worker has none of its own, from `processes`.
    """
    text = (
        "import sys; from distributed import LocalCluster\n"
        "if __name__ == '__main__':\n"
        f"    options = {{'n_workers': 1, 'threads_per_worker': 1, 'processes': {processes}}}\n"
        "    cluster = LocalCluster(**options, protocol='tcp://', dashboard_address=None)\n"
        f"    open({str(address)!r}, 'w').write(cluster.scheduler_address)\n"
        "    for line in sys.stdin:\n"
        "        cluster.scale(0)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stderr=subprocess.DEVNULL)
    begin = time.monotonic()
    while not (address.is_file() and address.read_text()) and time.monotonic() - begin < 60.0:
        time.sleep(0.05)
    return process


def _kill_worker(process: "subprocess.Popen[bytes]", out: Path) -> None:
    begin = time.monotonic()
    while not list(out.glob("points/*")) and time.monotonic() - begin < 60.0:
        time.sleep(0.05)
    assert process.stdin is not None
    process.stdin.write(b"kill\n")
    process.stdin.flush()
