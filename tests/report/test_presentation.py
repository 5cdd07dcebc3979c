"""If these fail, a run ends without its figures, or leaves a process behind that nobody ends."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import Interrupted, RunError
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.report.presentation import FIGURES, Presentation

_STILL = {"boundaries.png", "fiber_layout.png", "geometry.png", "stimulus.png", "transmural_directions.png"}
_IN_TIME = {"cavity_volumes.png", "potential_at_probes.png", "potential_snapshots.png"}


def _processes(out: Path) -> list[int]:
    """Those that draw the figures of the results in `out`."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                arguments = (entry / "cmdline").read_bytes().split(b"\0")
                ended = (entry / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
            except OSError:
                continue
            if str(out).encode() in arguments and b"cardiac_cosim.report" in arguments:
                found += [] if ended else [int(entry.name)]
    return found


def _is_gone(out: Path) -> bool:
    until = time.monotonic() + 30.0
    while _processes(out):
        if time.monotonic() > until:
            return False
        time.sleep(0.02)
    return True


def _draw(scenario: Path, out: Path, *sets: str, resume: bool = False) -> tuple[str, ...]:
    loaded = load_scenario(scenario, ("run.stop_ms=5", *sets))
    companion = Presentation(out, loaded.name, parts=(FIGURES,))
    return run_scenario(loaded, scenario.parent, out, resume=resume, companion=companion).warnings


def test_a_run_and_one_that_goes_on_are_drawn_alike(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sets = ("output.every_ms=1", "run.checkpoint_every=1")
    assert _draw(small_scenario, tmp_path / "whole", *sets) == ()
    pictures = {path.name for path in (tmp_path / "whole" / "figures").iterdir()}
    assert pictures >= _STILL | _IN_TIME
    # What does not change is drawn at the begin, which a resumed run has not.
    with monkeypatch.context() as patch:
        patch.setattr("cardiac_cosim.orchestrator.run.StopRequest", _StopsAtOnce)
        with pytest.raises(Interrupted):
            _draw(small_scenario, tmp_path / "resumed", *sets)
    assert not (tmp_path / "resumed" / "figures").exists()
    assert _draw(small_scenario, tmp_path / "resumed", *sets, resume=True) == ()
    for name in pictures:
        one, other = ((tmp_path / folder / "figures" / name).read_bytes() for folder in ("whole", "resumed"))
        assert one == other, name
    assert _is_gone(tmp_path / "whole")
    assert _is_gone(tmp_path / "resumed")


class _StopsAtOnce:
    """A signal that came before the third step."""

    signal = signal.SIGTERM

    def __init__(self) -> None:
        self._asked = 0

    def __bool__(self) -> bool:
        self._asked += 1
        return self._asked > 2

    def __enter__(self) -> "_StopsAtOnce":
        return self

    def __exit__(self, *error: object) -> None:
        pass


def test_a_run_that_fails_leaves_no_process_that_waits_to_draw(small_scenario: Path, tmp_path: Path) -> None:
    with pytest.raises(RunError):
        _draw(small_scenario, tmp_path / "out", "units.mechanics.parameters.neo_hooke_log_sign=as_printed")
    assert _processes(tmp_path / "out") == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes end each other by the end of a pipe only")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_whatever_ends_a_run_ends_the_process_that_draws(number: int, small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    command = [sys.executable, "-m", "cardiac_cosim.cli", "run", str(small_scenario), "--output", str(out)]
    process = subprocess.Popen(
        [*command, "--set", "run.stop_ms=1000"],
        stderr=subprocess.PIPE,
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    series = out / "timeseries.csv"
    while process.poll() is None and not (series.is_file() and series.read_text().count("\n") > 3):
        time.sleep(0.01)
    assert len(_processes(out)) == 1
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode in (-number, 128 + number)
    assert _is_gone(out)


def test_a_process_that_cannot_draw_is_told_of_and_spoils_nothing(tmp_path: Path) -> None:
    with Presentation(tmp_path, parts=(FIGURES,)) as drawing:
        for process in _processes(tmp_path):
            os.kill(process, signal.SIGKILL)
        assert _is_gone(tmp_path)
        drawing.begin()
        (warning,) = drawing.finish()
    assert "the process that makes them ended; all other results are complete" in warning


def test_where_no_process_can_be_started_there_are_no_figures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "no python"))
    with Presentation(tmp_path, parts=(FIGURES,)) as drawing:
        drawing.begin()
        (warning,) = drawing.finish()
    assert "could not be made" in warning


def test_a_bug_in_drawing_looks_like_one(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "fields.h5", "w") as file:
        file["points_mm"], file["cells"], file["fiber"] = np.eye(4, 3), [[0, 1, 2, 99]], [[1.0, 0.0, 0.0]]
    with Presentation(tmp_path, parts=(FIGURES,)) as drawing:
        drawing.begin()
        with pytest.raises(RuntimeError, match=r"IndexError: .*99"):
            drawing.finish()


def test_a_file_of_a_librarys_name_where_we_are_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "matplotlib.py").write_text("raise SystemExit('run')")
    with Presentation(tmp_path, parts=(FIGURES,)) as drawing:
        drawing.begin()
        assert drawing.finish() == ()
