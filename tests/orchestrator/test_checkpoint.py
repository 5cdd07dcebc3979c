"""If these fail, a long run that is killed has to be done again, or goes on as another run than it was."""

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.checkpoint import Checkpoint, read_checkpoint
from cardiac_cosim.orchestrator.results.origin import Origin
from cardiac_cosim.orchestrator.results.parts import Parts
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

_ITERATED = (
    "coupling={scheme: jacobi, interpolation: linear, extrapolation: 1, adaptive: {tolerance: 0.3}, "
    "iterate: {acceleration: anderson, converge: {stretch: {relative: 1e-4}}}}"
)


def _run(scenario: Path, out: Path, *sets: str, resume: bool = False) -> dict[str, Any]:
    return run_scenario(load_scenario(scenario, sets), scenario.parent, out, None, scenario.parent, resume).summary


def _command(scenario: Path, out: Path, *sets: str) -> list[str]:
    command = [sys.executable, "-m", "cardiac_cosim.cli", "run", str(scenario), "--output", str(out)]
    return [
        *command,
        "--no-figures",
        "--no-report",
        "--fmu-dir",
        str(scenario.parent),
        *(p for text in sets for p in ("--set", text)),
    ]


def _content(out: Path) -> dict[str, Any]:
    """All of the results but the times measured."""
    found: dict[str, Any] = {name: (out / name).read_bytes() for name in ("timeseries.csv", "fields.h5", "fields.xdmf")}
    if (out / "iterations.csv").is_file():
        found["iterations.csv"] = (out / "iterations.csv").read_bytes()
    lines = (out / "coupling.csv").read_text().splitlines()
    kept = [place for place, name in enumerate(lines[0].split(",")) if not name.startswith("seconds_")]
    found["coupling.csv"] = [[line.split(",")[place] for place in kept] for line in lines]
    summary = json.loads((out / "summary.json").read_text())
    for measured in ("wall_s", "cpu_s", "master_overhead"):
        del summary[measured]
    return found | {"summary.json": summary}


@pytest.mark.parametrize("participants", ["native", "fmu"])
@pytest.mark.parametrize("coupling", ["coupling.step_ms=1", _ITERATED], ids=["explicit", "adaptive and iterated"])
def test_killed_at_any_moment_and_resumed_it_is_the_run_that_was_never_killed(
    participants: str, coupling: str, small_scenario: Path, tmp_path: Path
) -> None:
    sets = (coupling, f"run.participants={participants}", "run.stop_ms=80", "run.checkpoint_every=4")
    _run(small_scenario, tmp_path / "whole", *sets)
    out = tmp_path / "killed"
    chance = random.Random(f"{participants} {coupling}")
    deaths = 0
    command = _command(small_scenario, out, *sets)
    for _ in range(12):
        process = subprocess.Popen([*command, "--resume"], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        begin = time.monotonic()
        rows = _rows(out)
        # Once the run has gone on from where it was, at a random moment of the next few steps.
        while process.poll() is None and _rows(out) in (0, rows) and time.monotonic() - begin < 60.0:
            time.sleep(0.005)
        time.sleep(chance.uniform(0.0, 0.06))
        process.kill()
        process.communicate()
        deaths += process.returncode == -signal.SIGKILL
        if (out / "timeseries.csv").is_file():
            # What is there can be read, all of it.
            with h5py.File(out / "fields.h5") as file:
                for name in file["frames"]:
                    assert np.isfinite(file[f"frames/{name}"][:]).all()
        if process.returncode == 0 or deaths == 3:
            break
    assert deaths >= 2
    summary = _run(small_scenario, out, *sets, resume=True)
    assert summary["status"] == "done"
    assert _content(out) == _content(tmp_path / "whole")
    assert not (out / "checkpoint.h5").exists()
    assert not (out / "fields.parts").exists()


def _rows(out: Path) -> int:
    path = out / "timeseries.csv"
    return path.read_text().count("\n") if path.is_file() else 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_by_a_signal_it_goes_on_from_that_very_step(number: int, small_scenario: Path, tmp_path: Path) -> None:
    sets = ("run.stop_ms=40", "run.checkpoint_every=1000")
    _run(small_scenario, tmp_path / "whole", *sets)
    out = tmp_path / "stopped"
    process = subprocess.Popen(
        _command(small_scenario, out, *sets),
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    while process.poll() is None and _rows(out) < 6:
        time.sleep(0.005)
    process.send_signal(number)
    _, message = process.communicate(timeout=120)
    assert process.returncode == 128 + number
    assert "continue with --resume" in message
    # Without the header and the initial state.
    reached = _rows(out) - 2
    assert 4 <= reached < 40
    summary = json.loads((out / "summary.json").read_text())
    assert (summary["status"], summary["resumable"], summary["steps"]) == ("interrupted", True, reached)
    with h5py.File(out / "fields.h5") as file:
        assert len(file["frames_ms"]) == reached // 5 + 1
    _run(small_scenario, out, *sets, resume=True)
    assert _content(out) == _content(tmp_path / "whole")


def test_resuming_what_is_complete_changes_nothing_and_what_is_not_there_begins(
    small_scenario: Path, tmp_path: Path
) -> None:
    first = _run(small_scenario, tmp_path / "out", resume=True)
    before = (tmp_path / "out" / "timeseries.csv").stat().st_mtime_ns
    assert _run(small_scenario, tmp_path / "out", resume=True) == first
    assert (tmp_path / "out" / "timeseries.csv").stat().st_mtime_ns == before
    # Of another scenario, it begins anew.
    assert _run(small_scenario, tmp_path / "out", "run.stop_ms=5", resume=True)["steps"] == 5


def test_a_checkpoint_of_another_scenario_or_a_damaged_one_is_refused(small_scenario: Path, tmp_path: Path) -> None:
    origin = Origin.of(load_scenario(small_scenario), tmp_path)
    Checkpoint(tmp_path, origin, {"part": lambda: {"a/b": {"c.d": np.arange(3.0)}, ".": {}, "n": 4}}).write()
    memory = read_checkpoint(tmp_path, origin)
    assert memory is not None
    assert memory["part"]["a/b"]["c.d"].tolist() == [0.0, 1.0, 2.0]
    assert memory["part"]["."] == {}
    assert int(memory["part"]["n"]) == 4
    other = load_scenario(small_scenario, ["coupling.step_ms=5", "units.fibers.parameters.endocardial_angle_deg=50"])
    with pytest.raises(
        InputError, match=r"coupling\.step_ms, units\.fibers\.parameters\.endocardial_angle_deg changed"
    ):
        read_checkpoint(tmp_path, Origin.of(other, tmp_path))
    (tmp_path / "checkpoint.h5").write_bytes(b"nonsense")
    with pytest.raises(InputError, match="run without --resume"):
        read_checkpoint(tmp_path, origin)
    assert read_checkpoint(tmp_path / "nowhere", origin) is None


def test_a_run_from_the_beginning_leaves_nothing_of_an_earlier_checkpoint(small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    Checkpoint(out, Origin.of(load_scenario(small_scenario), tmp_path), {}).write()
    Parts(out / "fields.parts").add(77.0, {"x": np.zeros(3)})
    assert _run(small_scenario, out)["status"] == "done"
    assert sorted(path.name for path in out.iterdir()) == [
        "coupling.csv",
        "fields.h5",
        "fields.xdmf",
        "profile.json",
        "summary.json",
        "timeseries.csv",
    ]


def test_a_frame_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    parts = Parts(tmp_path / "parts")
    parts.add(1.0, {"x": np.arange(3.0)})
    with pytest.raises(TypeError):
        parts.add(2.0, {"x": np.arange(3.0), "y": object()})  # type: ignore[dict-item]
    again = Parts(tmp_path / "parts", kept=1)
    assert again.times == [1.0]
    with again.open(0) as frame:
        assert frame["x"][:].tolist() == [0.0, 1.0, 2.0]


@pytest.mark.long
@pytest.mark.parametrize("coupling", ["coupling.step_ms=1", _ITERATED], ids=["explicit", "adaptive and iterated"])
def test_killed_dozens_of_times_at_random_moments_of_its_whole_life_nothing_is_lost_and_nothing_left(
    coupling: str, small_scenario: Path, tmp_path: Path
) -> None:
    sets = (coupling, "run.participants=native", "run.stop_ms=30", "output.every_ms=2", "run.checkpoint_every=3")
    _run(small_scenario, tmp_path / "whole", *sets)
    files = {path.name for path in (tmp_path / "whole").iterdir()}
    out = tmp_path / "killed"
    command = [*_command(small_scenario, out, *sets), "--resume"]
    chance = random.Random(coupling)
    begun = time.monotonic()
    subprocess.run(command, check=True, capture_output=True)
    life = time.monotonic() - begun
    shutil.rmtree(out)
    deaths = completions = 0
    while deaths < 36:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        # The end, where files are completed and removed, is the most delicate.
        time.sleep(chance.choice([chance.uniform(0.3, 1.0), chance.uniform(0.6, 1.0), 0.9]) * life)
        process.kill()
        _, told = process.communicate()
        assert process.returncode in (0, -signal.SIGKILL), told
        deaths += process.returncode != 0
        for path in (out / "fields.h5", out / "timeseries.csv"):
            if path.is_file():
                _readable(path)
        done = (out / "summary.json").is_file() and json.loads((out / "summary.json").read_text())["status"] == "done"
        if done:
            assert _run(small_scenario, out, *sets, resume=True)["status"] == "done"
            assert _content(out) == _content(tmp_path / "whole")
            assert {path.name for path in out.iterdir()} == files
            completions += 1
            shutil.rmtree(out)
    _run(small_scenario, out, *sets, resume=True)
    assert _content(out) == _content(tmp_path / "whole")
    assert {path.name for path in out.iterdir()} == files
    assert completions > 0


def _readable(path: Path) -> None:
    if path.suffix == ".csv":
        assert np.isfinite(np.genfromtxt(path, delimiter=",", skip_header=1)).all()
        return
    with h5py.File(path) as file:
        for name in file["frames"]:
            assert np.isfinite(file[f"frames/{name}"][:]).all()


@pytest.mark.long
def test_memory_does_not_grow_over_ten_thousand_steps_with_rollback(small_scenario: Path, tmp_path: Path) -> None:
    # Of the heart's FMUs the small ones: what leaks is the number of states, not their size.
    text = small_scenario.read_text().replace("  mechanics: {unit: mechanics}\n", "")
    (tmp_path / "fibre.yaml").write_text(text)
    sizes = {}
    for steps in (2_000, 12_000):
        code = f"""
import resource, sys
from pathlib import Path
from cardiac_cosim.orchestrator.coupling import build
from cardiac_cosim.orchestrator.coupling.step_control import FixedStep
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

class RefusesOnce(FixedStep):
    refuses, again = True, False
    def good(self, exchange, ticks):
        self.again = not self.again
        return not self.again

build.FixedStep = RefusesOnce
sets = ["coupling.step_ms=0.01", "run.stop_ms={steps / 100}", "output.every_ms={steps / 100}", "run.participants=fmu",
        "run.checkpoint_every=0"]
base = Path({str(tmp_path)!r})
run_scenario(load_scenario(base / "fibre.yaml", sets), base, base / "out{steps}", None, base)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        sizes[steps] = int(done.stdout)
    # The time series is kept in memory; the states of ten thousand steps would be 400 MB.
    assert sizes[12_000] - sizes[2_000] < 20_000, sizes
