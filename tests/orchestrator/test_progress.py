"""If these fail, a person does not see how long a run will take: on a narrow terminal, in a log file, or at all."""

import io
import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator import progress
from cardiac_cosim.orchestrator.progress import Progress, bar_row, clock
from rich.console import Console

_WORDS = ("127 of 320 ms", "step 127, sweeps 3")
_TIMES = "elapsed 0:02, remaining 0:40"


class _Clock:
    """A clock that somebody sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> _Clock:
    watch = _Clock()
    monkeypatch.setattr(progress, "time", watch)
    return watch


def _drawn(width: int, title: str = "baseline", times: str = _TIMES, share: float = 1.0) -> str:
    console = Console(width=width, file=io.StringIO(), force_terminal=True, color_system=None)
    console.print(bar_row(title, _WORDS, share, times, width))
    drawn = console.file.getvalue()  # type: ignore[attr-defined]
    assert drawn.count("\n") == 1
    assert len(drawn.rstrip("\n")) <= width
    return str(drawn.rstrip())


def test_the_bar_gives_up_what_matters_less_first_and_itself_last() -> None:
    assert _drawn(120) == f"baseline {_WORDS[0]} {'━' * 40} {_WORDS[1]} {_TIMES}"
    wide = _drawn(80)
    assert wide.startswith(f"baseline {_WORDS[0]} ━━━━━━━━━━")
    assert wide.endswith(_TIMES)
    assert _drawn(60) == f"{_WORDS[0]} {'━' * 17} {_TIMES}"
    assert _drawn(40) == f"{'━' * 11} {_TIMES}"
    assert _drawn(25) == f"{'━' * 10} remaining 0:40"
    assert set(_drawn(12)) == {"━"}


@pytest.mark.parametrize("width", [20, 40, 80])
def test_the_bar_stays_whatever_the_title_is_and_the_time_takes(width: int) -> None:
    drawn = _drawn(width, "a_name_that_is_longer_than_the_terminal_is_wide", "elapsed 11:00:02, remaining 103:01:40")
    assert "━" * 10 in drawn


def test_half_of_the_bar_is_half_of_the_run() -> None:
    assert _drawn(40, share=0.5).count("━") + _drawn(40, share=0.5).count("╸") == 6


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (7, "0:07"), (760, "12:40"), (3723, "1:02:03")])
def test_times_are_told_as_clocks_tell_them(seconds: float, text: str) -> None:
    assert clock(seconds) == text


def _piped(watch: _Clock, seconds: float, done: float = 0.0, quiet: bool = False) -> list[str]:
    """The lines of a thousand steps that take so many seconds in all, beginning with those that were `done`."""
    file = io.StringIO()
    with Progress(Console(file=file, width=40, quiet=quiet), "baseline", 1000.0) as shown:
        for step in range(int(done), 1001):
            shown.update(step, f"{step} of 1000 ms", "step")
            watch.now += seconds / 1000.0
    return file.getvalue().splitlines()


def test_in_a_pipe_there_is_an_estimate_after_seconds_and_then_a_line_for_every_tenth(watch: _Clock) -> None:
    lines = _piped(watch, 125.0)
    assert lines[0] == "baseline: 1 % (16 of 1000 ms), elapsed 0:02, remaining 2:03"
    assert [re.findall(r"(\d+) %", line)[0] for line in lines[1:]] == [f"{10 * part}" for part in range(1, 11)]
    assert lines[5] == "baseline: 50 % (500 of 1000 ms), elapsed 1:02, remaining 1:02"
    assert lines[-1] == "baseline: 100 % (1000 of 1000 ms), elapsed 2:05"


def test_what_is_done_in_a_moment_is_done_without_a_word(watch: _Clock) -> None:
    assert _piped(watch, 1.9) == []
    assert _piped(watch, 1000.0, quiet=True) == []


def test_what_an_earlier_process_did_does_not_make_the_rest_look_fast(watch: _Clock) -> None:
    lines = _piped(watch, 125.0, done=900)
    assert lines[0] == "baseline: 91 % (916 of 1000 ms), elapsed 0:02, remaining 0:10"


def test_a_terminal_that_cannot_draw_gets_lines(watch: _Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    file = io.StringIO()
    with Progress(Console(file=file, force_terminal=True, width=80), "baseline", 2.0) as shown:
        for step in range(3):
            shown.update(step)
            watch.now += 3.0
    assert file.getvalue() == "baseline: 50 %, elapsed 0:03, remaining 0:03\nbaseline: 100 %, elapsed 0:06\n"


def test_a_run_says_as_much_as_it_is_asked_to(
    cosim: Callable[..., Any], small_scenario: Path, tmp_path: Path, fmu_dir: Path
) -> None:
    run = ("run", small_scenario, "--output", tmp_path / "out", "--fmu-dir", fmu_dir, "--set", "run.stop_ms=5")
    quiet = cosim(*run, "--quiet", "--set", "coupling.step_ms=5", "--set", "scene.mesh_size_mm=1")
    # Errors are said all the same, and so are warnings.
    assert quiet.code == 2
    assert "mesh_size_mm" in quiet.err
    iterate = "coupling.iterate={max_iterations: 1, on_limit: warn, converge: {stretch: {relative: 1e-9}}}"
    quiet = cosim(*run, "--quiet", "--set", iterate)
    assert (quiet.code, quiet.out) == (0, "")
    assert "steps were accepted without having converged" in quiet.err
    assert all(line.startswith("warning: ") for line in quiet.err.splitlines())
    told = cosim(*run, "--verbose", "--participants", "fmu")
    assert told.code == 0
    for words in ("mesh: 271 nodes", "mechanics: the FMU ", "electrophysiology computes with", "5 of 5 ms, step 5"):
        assert words in told.err
    # What one call asks for is not asked for by the next in the same process.
    assert cosim(*run).err == ""
    both = cosim(*run, "--quiet", "--verbose")
    assert (both.code, "contradict" in both.err) == (2, True)
    assert logging.getLogger("cardiac_cosim").level == logging.NOTSET
