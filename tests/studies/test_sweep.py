"""If these fail, a table of variants has a row of another run, lacks one, or runs what nobody asked for."""

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.studies.plan import Variants
from cardiac_cosim.studies.sweep import plan_sweep, varied_values


def test_values_are_read_as_yaml_has_them() -> None:
    found = varied_values(["coupling.step_ms=1,2.5", "coupling.iterate=null,{converge: {x: {relative: 1e-3}}}", "a=b"])
    assert found == {
        "coupling.step_ms": [1, 2.5],
        "coupling.iterate": [None, {"converge": {"x": {"relative": 1e-3}}}],
        "a": ["b"],
    }


@pytest.mark.parametrize("arguments", [["a"], ["a="], ["=1"], ["a=1", "a=2"], ["a={"], []])
def test_what_varies_nothing_is_refused_with_an_example(arguments: list[str]) -> None:
    with pytest.raises(InputError, match=r"key\.path|coupling\.step_ms|all its values|values are"):
        varied_values(arguments)


def test_variants_that_cannot_stand_together_are_no_runs_and_have_a_reason(small_cell: Path) -> None:
    variants = Variants(small_cell, {}, str(small_cell))
    good, bad = plan_sweep(variants, {"coupling.step_ms": [2, 3]})
    assert good.point is not None
    assert good.point.scenario.coupling.step_ms == 2
    assert bad.point is None
    assert "whole number of steps" in bad.reason
    with pytest.raises(InputError, match="none of the runs is possible"):
        plan_sweep(variants, {"coupling.step_ms": [3, 7]})
    with pytest.raises(InputError, match="did you mean 'step_ms'"):
        plan_sweep(variants, {"coupling.step": [1]})
    with pytest.raises(InputError, match="give fewer"):
        plan_sweep(variants, {"coupling.step_ms": list(range(1, 200)), "run.stop_ms": list(range(1, 200))})


def test_a_sweep_runs_every_combination_once_and_shows_them_together(
    cosim: Callable[..., Any], small_cell: Path, tmp_path: Path
) -> None:
    output = ["--output", str(tmp_path / "out"), "--set", "run.stop_ms=12"]
    key = "units.electrophysiology.parameters.excitation_rate"
    ended = cosim("sweep", small_cell, "coupling.step_ms=1,2", f"{key}=8,9", *output, "--set", "output.every_ms=4")
    assert ended.code == 0, ended.err
    assert "4 of 4 variants ran to their end" in ended.out
    with (tmp_path / "out" / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["coupling.step_ms"], row[key]) for row in rows] == [("1", "8"), ("1", "9"), ("2", "8"), ("2", "9")]
    stress = [float(row["active_stress_mean_max_kPa"]) for row in rows]
    assert stress[0] != stress[1]
    assert all((tmp_path / "out" / row["folder"] / "timeseries.csv").is_file() for row in rows)
    page = (tmp_path / "out" / "sweep.html").read_text()
    assert "active stress mean" in page
    # One more value is one more run; the others stay as they are.
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "points").glob("*/trial.json")}
    ended = cosim("sweep", small_cell, "coupling.step_ms=1,2,4", f"{key}=8", *output, "--set", "output.every_ms=4")
    assert ended.code == 0, ended.err
    after = {path: path.stat().st_mtime_ns for path in (tmp_path / "out" / "points").glob("*/trial.json")}
    assert len(after) == len(before) + 1
    assert before.items() <= after.items()
