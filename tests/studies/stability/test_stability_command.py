"""If these fail, a map that is interrupted is lost, or is another one with more workers."""

import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pandas

_COMMAND = [sys.executable, "-m", "cardiac_cosim.cli", "stability"]

#: Without the theory of the tests, which another process does not have.
_REPLACED = (("theory: masses\n", ""), ("bisect: 4\n", ""))


def _without_theory(study: Path) -> Path:
    text = study.read_text()
    for before, after in _REPLACED:
        text = text.replace(before, after)
    study.write_text(text)
    return study


def _trials(out: Path) -> dict[str, int]:
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("points/*/trial.json")}


def test_interrupted_it_goes_on_where_it_was_and_more_workers_find_the_same(
    limit_study: Path, tmp_path: Path, cosim: Callable[..., Any]
) -> None:
    study, out = _without_theory(limit_study), tmp_path / "out"
    process = subprocess.Popen(
        [*_COMMAND, str(study), "--output", str(out)],
        stderr=subprocess.PIPE,
        text=True,
        # Whoever runs the tests in the background lets them ignore it.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    begin = time.monotonic()
    while not _trials(out) and process.poll() is None and time.monotonic() - begin < 60.0:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 128 + signal.SIGINT
    assert "the same command continues from there" in told
    assert not (out / "stability.csv").exists()
    seen = _trials(out)
    assert 1 <= len(seen) < 8
    done = cosim("stability", study, "--output", out)
    assert (done.code, done.err) == (0, "")
    now = _trials(out)
    assert {name: now[name] for name in seen} == seen
    assert len(now) == 8
    many = tmp_path / "many"
    assert cosim("stability", study, "--output", many, "--workers", 2).code == 0
    kept = ["x", "y", "class", "measure", "line", "bisected", "folder"]
    tables = [pandas.read_csv(folder / "stability.csv")[kept] for folder in (out, many)]
    pandas.testing.assert_frame_equal(*tables)


def test_a_study_that_is_no_map_is_told(limit_study: Path, tmp_path: Path, cosim: Callable[..., Any]) -> None:
    limit_study.write_text(limit_study.read_text().replace("      coupling.step_ms: [20, 50, 110, 250]\n", ""))
    ended = cosim("stability", limit_study, "--output", tmp_path / "out")
    assert ended.code == 2
    assert ended.err.startswith(f"error: {limit_study}: lines, 'held': a map has two axes")
    assert not (tmp_path / "out").exists()


def test_a_chart_of_a_map_without_a_reference_says_what_is_missing(
    limit_study: Path, tmp_path: Path, cosim: Callable[..., Any]
) -> None:
    ended = cosim("chart", limit_study, "--output", tmp_path / "out")
    assert ended.code == 2
    assert ended.err.startswith(f"error: {limit_study}: the key 'reference' is missing; say what")
    assert not (tmp_path / "out").exists()
