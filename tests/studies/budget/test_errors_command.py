"""If these fail, a script takes a budget for complete that is none, or stands beside the numbers of another run."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.results.comparison import headlines
from cardiac_cosim.orchestrator.results.stored_run import StoredRun

Cosim = Callable[..., Any]

_SHORT = ("--set", "run.stop_ms=10", "--set", "output.probes_mm={near: [8, 0, 0]}")


def _rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "errors.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_budget_is_told_written_and_not_computed_twice(strand: Path, tmp_path: Path, cosim: Cosim) -> None:
    out = tmp_path / "out"
    ended = cosim("errors", strand, *_SHORT, "--output", out)
    assert ended.code == 0, ended.err
    assert "activation at near: " in ended.out
    assert f"error budget in {out}" in ended.out
    rows = _rows(out)
    assert list(rows[0])[:6] == ["source", "quantity", "value", "estimate", "order", "trusted"]
    assert {row["trusted"] for row in rows} <= {"0", "1"}
    assert all(bool(row["reason"]) == (row["trusted"] == "0") for row in rows)
    assert len({(row["source"], row["quantity"]) for row in rows}) == len(rows)
    content = json.loads((out / "errors.json").read_text())
    assert all(text in ended.out for text in content["sentences"])
    assert set(content["sources"]) == {row["source"] for row in rows}
    assert (out / "errors.png").is_file()
    assert (out / "errors.svg").is_file()
    finished = {path: path.stat().st_mtime_ns for path in out.glob("points/*/trial.json")}
    again = cosim("errors", strand, *_SHORT, "--output", out)
    assert again.out == ended.out
    assert {path: path.stat().st_mtime_ns for path in out.glob("points/*/trial.json")} == finished


def test_a_run_with_a_budget_has_that_of_its_own_numbers(strand: Path, tmp_path: Path, cosim: Cosim) -> None:
    # By FMUs, while the budget calls the units directly.
    out = tmp_path / "run"
    by = ("--participants", "fmu", "--fmu-dir", tmp_path / "fmus")
    ended = cosim("run", strand, *_SHORT, *by, "--output", out, "--report", "--error-budget")
    assert ended.code == 0, ended.err
    assert ended.out.index("results in") < ended.out.index("± ")
    # The page of the run, which was there before, has the errors too.
    assert "±" in (out / "report.html").read_text(encoding="utf-8")
    values = {row["quantity"]: float(row["value"]) for row in _rows(out)}
    assert values == headlines(StoredRun(out))
    direct = cosim("errors", strand, *_SHORT, "--output", tmp_path / "direct")
    assert direct.code == 0
    assert _rows(tmp_path / "direct") == _rows(out)
    # Another run in the same folder does not stand beside the errors of this one.
    assert cosim("run", strand, *_SHORT, "--output", out, "--no-figures").code == 0
    assert not list(out.glob("errors.*"))


@pytest.mark.parametrize("command", ["errors", "run"])
def test_a_run_that_fails_ends_with_its_own_exit_code(command: str, strand: Path, tmp_path: Path, cosim: Cosim) -> None:
    strict = "coupling.iterate={max_iterations: 1, converge: {stretch: {relative: 1e-14}}}"
    budget = ("--error-budget", "--no-figures") if command == "run" else ()
    ended = cosim(command, strand, *_SHORT, "--set", strict, "--output", tmp_path / "out", *budget)
    assert ended.code == 3
    assert "failed: " in ended.err
    assert not (tmp_path / "out" / "errors.csv").exists()


def test_wrong_input_is_told_with_file_key_and_remedy(strand: Path, tmp_path: Path, cosim: Cosim) -> None:
    out = tmp_path / "out"
    for wrong, words in (
        (("--set", "coupling.stepms=1"), ("stepms", "did you mean")),
        (("--set", "units.mechanics.parameters.stiff=1"), ("has no parameter 'stiff'",)),
        (("--set", "units.electrophysiology.parameters.longest_substep_ms=3"), ("longest_substep_ms",)),
        (("--workers", 2, "--scheduler", "tcp://localhost:1"), ("--scheduler",)),
    ):
        ended = cosim("errors", strand, "--output", out, *wrong)
        assert ended.code == 2, ended
        assert "Traceback" not in ended.err
        assert all(word in ended.err for word in words), ended.err
        if wrong[0] == "--set":
            assert ended.err.startswith(f"error: {strand}")
            assert ended.err.count(str(strand)) == 1
    assert not (out / "errors.csv").exists()
    assert cosim("errors", tmp_path / "none.yaml").code == 2
