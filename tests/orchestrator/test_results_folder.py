"""If these fail, two runs mix their results in one folder, a run goes on from what was never its own, a full disk takes
the good steps with it, or a summary says `done` of what is not."""

import json
import os
import random
import re
import resource
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.convergence import Convergence, Criterion
from cardiac_cosim.orchestrator.coupling.schemes import Sweeps
from cardiac_cosim.orchestrator.errors import InputError, Interrupted, RunError
from cardiac_cosim.orchestrator.results import origin as origins
from cardiac_cosim.orchestrator.results.checkpoint import read_checkpoint
from cardiac_cosim.orchestrator.results.coupling_log import CouplingLog
from cardiac_cosim.orchestrator.results.fields import Fields
from cardiac_cosim.orchestrator.results.folder import ResultsFolder
from cardiac_cosim.orchestrator.results.hdf5 import write_sealed
from cardiac_cosim.orchestrator.results.iteration_log import IterationLog
from cardiac_cosim.orchestrator.results.origin import Origin
from cardiac_cosim.orchestrator.results.parts import Parts
from cardiac_cosim.orchestrator.results.recording import Recording
from cardiac_cosim.orchestrator.results.request import Request
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.report.presentation import Presentation
from cardiac_cosim.units.mesh.file import read_mesh, write_mesh
from fallbacks import without_fallbacks

Cosim = Callable[..., Any]

_SETS = ("run.stop_ms=8", "output.every_ms=2", "run.checkpoint_every=3")
_COMMAND = [sys.executable, "-m", "cardiac_cosim.cli"]
_FILES = {"coupling.csv", "fields.h5", "fields.xdmf", "profile.json", "summary.json", "timeseries.csv"}


def _run(scenario: Path, out: Path, *sets: str, resume: bool = False) -> dict[str, Any]:
    return run_scenario(load_scenario(scenario, [*_SETS, *sets]), scenario.parent, out, resume=resume).summary


def _arguments(scenario: Path, out: Path, *more: str) -> list[str]:
    return ["run", str(scenario), "--output", str(out), *(part for text in _SETS for part in ("--set", text)), *more]


def _bytes(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def _results(folder: Path) -> dict[str, Any]:
    """All that does not hang on the clock."""
    summary = json.loads((folder / "summary.json").read_text())
    for measured in ("wall_s", "cpu_s", "master_overhead"):
        del summary[measured]
    names = ("timeseries.csv", "fields.h5", "fields.xdmf")
    return {name: (folder / name).read_bytes() for name in names} | {"summary": summary}


def _interrupted(scenario: Path, out: Path, monkeypatch: pytest.MonkeyPatch, *sets: str, after: int = 5) -> None:
    """A run that was asked to stop after so many steps."""

    class Stops(Recording):
        def accept(self, step: Any, exchange: Any) -> None:
            super().accept(step, exchange)
            if step.number == after:
                raise Interrupted(15)

    with monkeypatch.context() as patch:
        patch.setattr("cardiac_cosim.orchestrator.results.folder.Recording", Stops)
        with pytest.raises(Interrupted):
            _run(scenario, out, *sets)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, small_heart_file: Path) -> Callable[[Path], Path]:
    """The results of the uninterrupted run of a scenario, computed once."""
    done: list[Path] = []

    def get(scenario: Path) -> Path:
        if not done:
            done.append(tmp_path_factory.mktemp("whole"))
            _run(scenario, done[0])
        return done[0]

    return get


# --- two runs at once ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", ["fresh", "complete", "interrupted"])
@pytest.mark.parametrize("resume", [False, True])
def test_a_second_run_in_a_folder_ends_with_2_and_touches_nothing(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, state: str, resume: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    if state == "complete":
        _run(small_scenario, out)
    elif state == "interrupted":
        _interrupted(small_scenario, out, monkeypatch)
    with ResultsFolder(out, Origin.of(load_scenario(small_scenario), tmp_path), Request()):
        before = _bytes(out)
        ended = cosim(*_arguments(small_scenario, out, *(["--resume"] if resume else [])))
        assert _bytes(out) == before
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert f"{out} is in use by process {os.getpid()}" in ended.err
    assert "--output" in ended.err
    # Nothing of the lock is left, nor of a folder that was made for nothing.
    assert not (out / ".lock").exists()
    assert out.exists() == (state != "fresh")


def test_of_two_runs_at_once_one_runs_and_the_other_is_told_by_whom(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    runs = [
        subprocess.Popen(
            [*_COMMAND, *_arguments(small_scenario, out, "--no-figures", "--no-report", "--set", "run.stop_ms=15")],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    told = {run.pid: run.communicate(timeout=120)[1] for run in runs}
    codes = sorted(run.returncode for run in runs)
    # One that came when another had ended runs as well, one after the other.
    assert codes[0] == 0
    assert set(codes) <= {0, 2}
    for run in runs:
        if run.returncode == 2:
            # That of the process that works, whose parent only watches it.
            assert re.search(r"in use by process \d+;", told[run.pid]), told
    assert json.loads((out / "summary.json").read_text())["status"] == "done"
    assert {path.name for path in out.iterdir()} == _FILES


def test_threads_of_one_process_exclude_each_other_too(small_scenario: Path, tmp_path: Path) -> None:
    origin = Origin.of(load_scenario(small_scenario), tmp_path)
    inside, most, refused = [0], [0], [0]
    guard = threading.Lock()

    def enter() -> None:
        for _ in range(200):
            try:
                with ResultsFolder(tmp_path / "out", origin, Request()):
                    with guard:
                        inside[0] += 1
                        most[0] = max(most[0], inside[0])
                    with guard:
                        inside[0] -= 1
            except InputError:
                refused[0] += 1

    threads = [threading.Thread(target=enter) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most[0] == 1
    assert refused[0] < 800


def test_the_lock_of_a_dead_process_is_no_obstacle(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom cardiac_cosim.orchestrator.results.lock import FolderLock\n"
        f"FolderLock(Path({str(out)!r}))\nos._exit(9)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 9
    assert (out / ".lock").is_file()
    assert _run(small_scenario, out)["status"] == "done"
    assert {path.name for path in out.iterdir()} == _FILES


# --- what changed since -------------------------------------------------------------------------------------------


def _move_a_node(path: Path) -> None:
    mesh = read_mesh(path)
    points = mesh.points.copy()
    points[0] += 1e-9
    path.unlink()
    write_mesh(type(mesh)(points, mesh.cells, mesh.boundaries), path)


@pytest.mark.parametrize("state", ["complete", "interrupted"])
@pytest.mark.parametrize("change", ["mesh", "no mesh", "program", "package"])
def test_what_changed_since_is_named_and_nothing_is_touched(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, state: str, change: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "own.msh").write_bytes(Path(load_scenario(small_scenario).scene.mesh).read_bytes())  # type: ignore[union-attr, arg-type]
    out = tmp_path / "out"
    if state == "complete":
        _run(small_scenario, out, "scene.mesh=own.msh")
    else:
        _interrupted(small_scenario, out, monkeypatch, "scene.mesh=own.msh")
    before = _bytes(out)
    if change == "mesh":
        _move_a_node(tmp_path / "own.msh")
    elif change == "no mesh":
        (tmp_path / "own.msh").unlink()
    elif change == "program":
        monkeypatch.setattr(origins, "program", lambda: "other")
    else:
        version = origins._version
        monkeypatch.setattr(origins, "_version", lambda name: "0.0.1" if name == "numpy" else version(name))
    ended = cosim(*_arguments(small_scenario, out, "--resume", "--set", "scene.mesh=own.msh"))
    assert (ended.code, ended.err.count("\n")) == (2, 1), ended
    words = {
        "mesh": "own.msh has changed since",
        "no mesh": "own.msh is missing",
        "program": "this program has changed",
    }
    assert words.get(change, "is 0.0.1") in ended.err
    assert "run without --resume" in ended.err
    assert _bytes(out) == before


def test_a_foreign_fmu_that_changed_is_named(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    assert cosim("build", small_scenario, "--output", tmp_path).code == 0
    arguments = _arguments(small_scenario, tmp_path / "out", "--set", "units.active_stress={fmu: active_stress.fmu}")
    assert cosim(*arguments).code == 0
    assert cosim(*arguments, "--resume").code == 0
    with (tmp_path / "active_stress.fmu").open("ab") as file:
        file.write(b"\0")
    ended = cosim(*arguments, "--resume")
    assert ended.code == 2
    assert "active_stress.fmu has changed since" in ended.err


def test_what_is_hashed_is_only_what_can_be_read_to_its_end(small_scenario: Path, tmp_path: Path) -> None:
    for name in ("/dev/zero", ".", "", "nowhere.msh", "a\0b", "x" * 300):
        scenario = load_scenario(small_scenario).model_copy(deep=True)
        object.__setattr__(scenario.scene, "mesh", name)
        assert Origin.of(scenario, tmp_path).files == {name: None}


# --- damaged checkpoints and results ------------------------------------------------------------------------------


def test_no_damage_to_a_checkpoint_is_taken_for_one_or_ends_in_a_traceback(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    _interrupted(small_scenario, out, monkeypatch)
    path = out / "checkpoint.h5"
    origin = Origin.of(load_scenario(small_scenario, _SETS), small_scenario.parent)
    assert read_checkpoint(out, origin) is not None
    good = path.read_bytes()
    chance = random.Random(8)
    damaged = [good[:size] for size in (0, 1, 31, 32, 33, 100, len(good) // 2, len(good) - 33, len(good) - 1)]
    for _ in range(200):
        place = chance.randrange(len(good))
        damaged.append(good[:place] + bytes([good[place] ^ 1 << chance.randrange(8)]) + good[place + 1 :])
    damaged += [good + b"\0", b"x" * len(good), bytes(len(good))]
    for content in damaged:
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"checkpoint\.h5: .*run without --resume"):
            read_checkpoint(out, origin)


@pytest.mark.parametrize("damage", ["missing", "a text", "another shape", "a group"])
def test_a_whole_checkpoint_that_lacks_something_is_refused_before_anything_is_touched(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, damage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    _interrupted(small_scenario, out, monkeypatch)
    path = out / "checkpoint.h5"
    with h5py.File(path) as source:
        stored = {key: source[key][()] for key in source}
        stored_format = source.attrs["format"]
    damages: dict[str, Any] = {"a text": ["<U4", [], 0], "another shape": ["<f8", [3, 0, 2], 0], "a group": {}}
    parts = (
        "master",
        "series",
        "log",
        "costs",
        "master/states",
        "master/tick",
        "master/solves",
        "fields/frames",
        "series/digest",
    )
    for name in ["origin", "index", "values", *parts]:
        content = dict(stored)
        if name in content:
            content[name] = {"missing": None, "a text": "text", "another shape": np.zeros((3, 0, 2))}.get(damage, {})
        else:
            index = json.loads(stored["index"])
            *groups, last = name.split("/")
            group = index
            for each in groups:
                group = group[each]
            del group[last]
            if damage != "missing":
                group[last] = damages[damage]
            content["index"] = json.dumps(index)

        def fill(file: h5py.File, content: dict[str, Any] = content) -> None:
            file.attrs["format"] = stored_format
            for key, value in content.items():
                if isinstance(value, dict):
                    file.create_group(key)
                elif value is not None:
                    file[key] = value

        write_sealed(path, fill)
        before = _bytes(out)
        ended = cosim(*_arguments(small_scenario, out, "--resume"))
        assert (ended.code, ended.err.count("\n")) == (2, 1), (name, ended)
        assert "run without --resume" in ended.err, (name, ended)
        assert _bytes(out) == before, name


@pytest.mark.parametrize("damage", ["shortened", "altered", "gone"])
@pytest.mark.parametrize("name", ["timeseries.csv", "coupling.csv", "fields.parts/1.h5"])
def test_results_that_are_not_as_they_were_left_are_not_gone_on_from(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, name: str, damage: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    _interrupted(small_scenario, out, monkeypatch)
    path = out / name
    content = path.read_bytes()
    if damage == "gone":
        path.unlink()
    else:
        half = len(content) // 3
        path.write_bytes(content[:half] + (bytes([content[half] ^ 1]) + content[half + 1 :]) * (damage == "altered"))
    before = _bytes(out)
    ended = cosim(*_arguments(small_scenario, out, "--resume"))
    assert (ended.code, ended.err.count("\n")) == (2, 1), ended
    assert name in ended.err
    assert "run without --resume" in ended.err
    assert _bytes(out) == before


@pytest.mark.parametrize("damage", ["shortened", "gone", "summary", "fields"])
def test_a_complete_run_without_its_results_is_not_called_complete(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, damage: str
) -> None:
    out = tmp_path / "out"
    _run(small_scenario, out)
    if damage == "shortened":
        lines = (out / "timeseries.csv").read_text().splitlines(keepends=True)
        (out / "timeseries.csv").write_text("".join(lines[:-2]))
    elif damage == "gone":
        (out / "timeseries.csv").unlink()
    elif damage == "fields":
        (out / "fields.h5").unlink()
    else:
        summary = json.loads((out / "summary.json").read_text())
        summary["wall_s"] = None
        (out / "summary.json").write_text(json.dumps(summary))
    ended = cosim(*_arguments(small_scenario, out, "--resume"))
    assert (ended.code, ended.err.count("\n")) == (2, 1), ended
    assert "run without --resume" in ended.err


@pytest.mark.parametrize("text", ["", "null", "[1]", "[" * 100_000, '{"status": "done"}', "9" * 5000, "\xff"])
def test_a_summary_that_is_none_is_no_complete_run(small_scenario: Path, tmp_path: Path, text: str) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "summary.json").write_text(text, encoding="latin-1")
    assert _run(small_scenario, tmp_path / "out", "run.stop_ms=2", resume=True)["steps"] == 2


def test_no_damage_to_a_summary_ends_in_a_traceback(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    _run(small_scenario, out, "run.stop_ms=2")
    before = _bytes(out)
    summary = json.loads(before["summary.json"])
    damaged: list[bytes] = []
    # Any value of any key replaced by something of another kind.
    for key, value in summary.items():
        for other in (None, "text", -1, [1, "x"], {"x": "y"}, {"total": None}):
            if type(other) is not type(value) or isinstance(value, (dict, list)):
                damaged.append(json.dumps(summary | {key: other}).encode())
    chance = random.Random(3)
    for content in chance.sample(damaged, 20):
        shutil.rmtree(out)
        out.mkdir()
        for name, data in (before | {"summary.json": content}).items():
            (out / name).write_bytes(data)
        ended = cosim(*_arguments(small_scenario, out, "--resume", "--set", "run.stop_ms=2"))
        assert (ended.code, ended.err.count("\n")) in ((0, 0), (2, 1)), (content, ended)


def test_what_a_process_left_that_was_killed_after_its_summary_is_removed(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    first = _run(small_scenario, out)
    Parts(out / "fields.parts").add(1.0, {"x": np.zeros(3)})
    for name in ("checkpoint.h5", "checkpoint.h5.part", "fields.h5.part", "fields.xdmf.part", "summary.json.part"):
        (out / name).write_bytes(b"left")
    (out / "theirs.part").write_bytes(b"not ours")
    assert _run(small_scenario, out, resume=True) == first
    assert {path.name for path in out.iterdir()} == _FILES | {"theirs.part"}


def test_nothing_of_an_earlier_kind_of_run_stays(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    iterate = "coupling.iterate={converge: {stretch: {relative: 1e-3}}}"
    _run(small_scenario, out, iterate, "run.stop_ms=2")
    assert (out / "iterations.csv").is_file()
    _run(small_scenario, out, "run.stop_ms=2")
    assert {path.name for path in out.iterdir()} == _FILES


# --- what a checkpoint costs --------------------------------------------------------------------------------------


def test_a_checkpoint_does_not_grow_with_the_steps_taken(small_scenario: Path, tmp_path: Path) -> None:
    text = small_scenario.read_text().replace("  mechanics: {unit: mechanics}\n", "")
    (tmp_path / "fibre.yaml").write_text(text)
    sizes = []

    class Watches(Recording):
        def accept(self, step: Any, exchange: Any) -> None:
            super().accept(step, exchange)
            if step.number in (20, 400):
                sizes.append((tmp_path / "out" / "checkpoint.h5").stat().st_size)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cardiac_cosim.orchestrator.results.folder.Recording", Watches)
        sets = ("coupling.step_ms=0.005", "run.stop_ms=2", "output.every_ms=2", "run.checkpoint_every=20")
        _run(tmp_path / "fibre.yaml", tmp_path / "out", *sets)
    assert sizes[0] == sizes[1]


def test_steps_that_did_not_converge_are_remembered_across_checkpoints_in_little_space(tmp_path: Path) -> None:
    def step(number: int, converged: bool) -> Any:
        from cardiac_cosim.orchestrator.coupling.master import Accepted

        return Accepted(number, 0.1 * number, 0.1, Sweeps((), converged), seconds={"a": 0.0, "master": 0.0})

    log = CouplingLog(tmp_path, ["a"])
    bad = [*range(2, 900), 950, *range(960, 1000)]
    for number in range(1, 1001):
        log.accept(step(number, number not in bad), None)  # type: ignore[arg-type]
    memory = log.memory()
    assert memory["unconverged"].size == 6
    again = CouplingLog(tmp_path, ["a"], (), memory)
    assert again.unconverged == log.unconverged == [0.1 * number for number in bad]


# --- how a run ended ----------------------------------------------------------------------------------------------


def test_a_crash_is_recorded_as_one_and_raised_all_the_same(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(self: Any, step: Any, exchange: Any) -> None:
        if step.number == 4:
            raise AssertionError("nobody expected this")

    monkeypatch.setattr("cardiac_cosim.orchestrator.results.profile.Profile.accept", crash)
    with pytest.raises(AssertionError):
        _run(small_scenario, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["status"], summary["resumable"]) == ("crashed", True)
    assert summary["message"] == "AssertionError: nobody expected this"


def test_whoever_ends_the_process_does_not_end_it_as_if_the_run_were_done(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def leave(self: Any, step: Any, exchange: Any) -> None:
        sys.exit(0)

    monkeypatch.setattr("cardiac_cosim.orchestrator.results.profile.Profile.accept", leave)
    ended = cosim(*_arguments(small_scenario, tmp_path / "out"))
    assert (ended.code, ended.err.count("\n")) == (3, 1)
    assert "ended the process (exit code 0)" in ended.err
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["status"] == "failed"


@pytest.mark.parametrize(("after", "resumable"), [(2, False), (3, True)])
def test_only_what_has_a_checkpoint_is_resumable(
    small_scenario: Path, tmp_path: Path, after: int, resumable: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    _interrupted(small_scenario, tmp_path / "out", monkeypatch, after=after)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["status"], summary["resumable"]) == ("interrupted", resumable)
    assert (tmp_path / "out" / "checkpoint.h5").exists() == resumable
    assert (tmp_path / "out" / "fields.parts").exists() == resumable


@pytest.mark.parametrize("problem", [OSError(5, "Input/output error"), ValueError("a bug")])
def test_a_file_that_cannot_be_closed_neither_loses_the_summary_nor_hides_the_physics(
    small_scenario: Path, tmp_path: Path, problem: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(self: Any) -> None:
        raise problem

    monkeypatch.setattr(Fields, "close", refuse)
    with pytest.raises(RunError, match=r"unit 'active_stress' failed in the step.*besides") as caught:
        _run(small_scenario, tmp_path / "out", "units.active_stress.parameters.delay_function=as_printed")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["status"], summary["message"]) == ("failed", str(caught.value))
    # The frames are what is left of the fields then.
    assert (tmp_path / "out" / "fields.parts" / "0.h5").is_file()
    # Without a failure of the physics it is one of its own.
    with pytest.raises(RunError if isinstance(problem, OSError) else ValueError):
        _run(small_scenario, tmp_path / "other")
    summary = json.loads((tmp_path / "other" / "summary.json").read_text())
    assert summary["status"] == ("failed" if isinstance(problem, OSError) else "crashed")
    assert summary["steps"] == 8


def test_the_sweeps_of_the_failing_step_are_in_the_iteration_log(tmp_path: Path) -> None:
    convergence = Convergence({"a.x": Criterion(absolute=1.0)})
    for residual in (8.0, 4.0, np.nan):
        convergence.judge({"a.x": np.array([residual])}, {"a.x": np.ones(1)})
    log = IterationLog(tmp_path, ["a.x"])
    log.failed(3.0, Sweeps((convergence,), False))
    log.close()
    lines = (tmp_path / "iterations.csv").read_text().splitlines()
    assert lines[1:] == ["3.0,1,8.0,", "3.0,2,4.0,0.5", "3.0,3,,"]


def test_a_failure_that_brings_its_sweeps_leaves_them_in_the_folder(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    convergence = Convergence({"mechanics.stretch": Criterion(absolute=1.0)})
    convergence.judge({"mechanics.stretch": np.array([8.0])}, {"mechanics.stretch": np.ones(1)})

    def fail(self: Any, step: Any, exchange: Any) -> None:
        if step.number == 2:
            error = RunError("no convergence")
            error.time_ms, error.sweeps = 3.0, Sweeps((convergence,), False)
            raise error

    monkeypatch.setattr("cardiac_cosim.orchestrator.results.profile.Profile.accept", fail)
    with pytest.raises(RunError):
        _run(small_scenario, tmp_path, "coupling.iterate={converge: {stretch: {relative: 1e-3}}}")
    assert (tmp_path / "iterations.csv").read_text().splitlines()[-1] == "3.0,1,8.0,"


# --- what the operating system refuses ----------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [90_000, 200_000])
def test_where_no_more_can_be_written_the_run_ends_with_3_and_goes_on_when_it_can(
    small_scenario: Path, tmp_path: Path, limit: int, whole: Callable[[Path], Path]
) -> None:
    out = tmp_path / "out"
    ended = subprocess.run(
        [*_COMMAND, *_arguments(small_scenario, out, "--no-figures", "--no-report")],
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=partial(resource.setrlimit, resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert ended.returncode == 3, ended
    told = without_fallbacks(ended.stderr)
    assert told.count("\n") == 1
    assert told.startswith("failed: the results cannot be written (")
    assert "File too large" in told
    summary = json.loads((out / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert summary["resumable"] == (out / "checkpoint.h5").exists()
    rows = np.genfromtxt(out / "timeseries.csv", delimiter=",", skip_header=1)
    assert np.isfinite(rows).all()
    with h5py.File(out / "fields.h5") as file:
        for name in file["frames"]:
            assert np.isfinite(file[f"frames/{name}"][:]).all()
    assert not list(out.rglob("*.part"))
    _run(small_scenario, out, resume=True)
    assert _results(out) == _results(whole(small_scenario))
    assert {path.name for path in out.iterdir()} == _FILES


def test_a_folder_that_vanishes_ends_the_run_with_3(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"

    class Vanishes(Recording):
        def accept(self, step: Any, exchange: Any) -> None:
            super().accept(step, exchange)
            if step.number == 4:
                shutil.rmtree(out)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cardiac_cosim.orchestrator.results.folder.Recording", Vanishes)
        with pytest.raises(RunError, match=r"cannot be written.*No such file.*up to 5 ms are complete"):
            _run(small_scenario, out)
    assert not out.exists()


def _may_be_read_by_all(path: Path) -> bool:
    return all(folder.stat().st_mode & 0o005 == 0o005 for folder in (path, *path.parents))


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
@pytest.mark.skipif(
    not (_may_be_read_by_all(Path(sys.prefix)) and _may_be_read_by_all(Path(__file__).parent)),
    reason="nobody else may read this project where it lies",
)
def test_a_folder_that_another_user_may_only_read_is_refused(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    complete, interrupted = tmp_path / "complete", tmp_path / "interrupted"
    _run(small_scenario, complete)
    _interrupted(small_scenario, interrupted, monkeypatch)
    for folder in (tmp_path, *tmp_path.parents):
        if folder.is_relative_to("/tmp") and folder != Path("/tmp"):
            folder.chmod(0o755)
    before = _bytes(complete), _bytes(interrupted)
    # Whoever this is may not read where Python lies; all that is needed is imported before.
    code = f"""
import os, sys
from pathlib import Path
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.report.presentation import Presentation
from cardiac_cosim.orchestrator.errors import InputError
path, folders = Path({str(small_scenario)!r}), (Path({str(complete)!r}), Path({str(interrupted)!r}))
scenario = load_scenario(path, {list(_SETS)!r})
os.setgroups([]), os.setgid(65534), os.setuid(65534)
for out in folders:
    for resume in (False, True):
        try:
            run_scenario(scenario, path.parent, out, resume=resume)
        except InputError as error:
            print(error)
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    told = [
        2 * f"the folder {out} cannot be written (Permission denied); choose another with --output\n"
        for out in (complete, interrupted)
    ]
    assert ended.stdout == "".join(told)
    assert (_bytes(complete), _bytes(interrupted)) == before


def test_figures_that_cannot_be_written_are_a_warning(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "figures").write_text("a file")
    scenario = load_scenario(small_scenario, _SETS)
    outcome = run_scenario(scenario, small_scenario.parent, tmp_path / "out", companion=Presentation(tmp_path / "out"))
    assert outcome.summary["status"] == "done"
    assert len(outcome.warnings) == 1
    assert "figures" in outcome.warnings[0]


@pytest.mark.parametrize("cache", ["/dev/null/x", "/proc/none"])
def test_without_a_place_for_a_cache_the_fmus_are_built_for_this_run(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, cache: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", cache)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    arguments = _arguments(small_scenario, tmp_path / "out", "--set", "run.stop_ms=2", "--participants", "fmu")
    ended = cosim(*arguments)
    assert (ended.code, ended.err) == (0, "")
    assert list((tmp_path / "temporary").iterdir()) == []
    # And where there is no place at all, it says what would be one.
    monkeypatch.setattr("tempfile.tempdir", cache)
    ended = cosim(*arguments)
    assert (ended.code, ended.err.count("\n")) == (2, 1), ended
    assert "--fmu-dir" in ended.err
