"""If these fail, a map shows another boundary than the runs have, or runs what was run before."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.studies.stability import StabilityMap
from cardiac_cosim.studies.stability.map import DIVERGED, INACCURATE, NOT_CONVERGED, NOT_RUN, SOUND, UNIT_FAILED
from oscillator import Oscillator

Mapped = Callable[..., StabilityMap]

#: Which inputs are followed, against the step; a step of 3 ms does not divide the run.
_STUDY = """\
name: accuracy
scenario: small_cell.yaml
reference: {coupling.step_ms: 0.25}
tolerances: {active_stress_mean_kPa: LIMIT}
lines:
  - name: inputs
    vary:
      coupling.interpolation: [hold, linear]
      coupling.step_ms: [1, 3, 10]
"""


@pytest.fixture
def cell_study(tmp_path: Path, small_cell: Path) -> Path:
    """A study of one cell with a categorical axis; the tolerance is to be set."""
    path = tmp_path / "accuracy.yaml"
    path.write_text(_STUDY.replace("LIMIT", "1.0"))
    return path


def _finished(out: Path) -> dict[str, int]:
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("points/*/trial.json")}


def test_the_measured_boundary_is_the_predicted_one_and_that_of_the_exact_matrix(
    limit_study: Path, tmp_path: Path, theory: Any, cosim: Callable[..., Any]
) -> None:
    done = cosim("stability", limit_study, "--output", tmp_path / "out")
    assert (done.code, done.err) == (0, "")
    (line, last) = done.out.splitlines()
    assert line.startswith(
        "held: 6 sound, 10 diverged; limit of coupling.step_ms at units.second.parameters.k_c = 10: "
    )
    assert last == f"  map in {tmp_path / 'out'}"
    told = json.loads((tmp_path / "out" / "stability.json").read_text())
    held = told["lines"]["held"]
    assert [crossing["x"] for crossing in held["crossings"]] == [10, 20]
    for crossing in held["crossings"]:
        oscillator = Oscillator((10.0, 20.0, crossing["x"]))
        limit = oscillator.first_unstable("FD", "gauss-seidel", 0, np.geomspace(1e-3, 0.3, 100))
        assert limit is not None
        assert crossing["low"] < 1000.0 * limit < crossing["high"]
        assert crossing["predicted"] == pytest.approx(1000.0 * limit, rel=1e-6)
        assert abs(crossing["difference"]) < 0.03
        assert crossing["high"] / crossing["low"] < 1.06
    (curve,) = held["limit"]
    assert {10.0, 20.0} <= {x for x, _ in curve}
    assert told["formula"] == theory.formula
    table = pandas.read_csv(tmp_path / "out" / "stability.csv")
    assert list(table.columns) == [
        *("x", "y", "class", "reason", "measure", "predicted", "line", "bisected", "wall_s", "cpu_s", "folder")
    ]
    # Measured growth and theory agree in every cell, and the class is what they say.
    np.testing.assert_allclose(table["measure"], table["predicted"], rtol=1e-7)
    assert (table["class"] == np.where(table["predicted"] > 1.0, DIVERGED, SOUND)).all()
    assert list(table["bisected"]) == [0] * 8 + [1] * 8
    assert all((tmp_path / "out" / "points" / folder / "summary.json").is_file() for folder in table["folder"])
    # One run of so many steps each; where the spring broke it ended before.
    steps = json.loads((tmp_path / "out" / "points" / table["folder"][0] / "summary.json").read_text())
    assert (steps["steps"], steps["end_ms"]) == (200, 4000.0)
    # Nothing is run twice.
    before = _finished(tmp_path / "out")
    assert len(before) == 16
    again = cosim("stability", limit_study, "--output", tmp_path / "out")
    assert again.out == done.out
    assert _finished(tmp_path / "out") == before


def test_what_a_theory_is_told_is_what_the_scenario_has(limit_study: Path, theory: Any, mapped: Mapped) -> None:
    text = limit_study.read_text().replace("bisect: 4", "bisect: 0")
    limit_study.write_text(
        text.replace(
            "    vary:", "    set: {coupling.scheme: jacobi, coupling.order: [second, first]}\n    vary:"
        ).replace("theory: masses", "theory: told")
    )
    with pytest.raises(InputError, match=r"theory: unknown theory 'told'.*masses"):
        mapped(limit_study)
    limit_study.write_text(limit_study.read_text().replace("theory: told", "theory: masses"))
    with pytest.raises(InputError) as problem:
        mapped(limit_study)
    assert str(problem.value).startswith(
        f"{limit_study}: theory: 'masses' does not fit the scenario: it is of two masses"
    )
    coupled = theory.asked[0]
    assert list(coupled.units) == ["second", "first"]
    assert coupled.units["first"].kind == "fmu"
    assert coupled.units["second"].parameters == {"k": 20, "c": 0.3, "k_c": 10, "c_c": 0.5, "x": 0.5}
    assert (coupled.jacobi, coupled.step_ms, coupled.linear, coupled.extrapolation) == (True, 20, False, 0)
    assert (coupled.mesh, list(coupled.moments())) == (None, [])


def test_cells_that_err_by_more_than_is_allowed_are_inaccurate(
    cell_study: Path, tmp_path: Path, cosim: Callable[..., Any]
) -> None:
    done = cosim("stability", cell_study, "--output", tmp_path / "out")
    assert done.code == 0
    table = pandas.read_csv(tmp_path / "out" / "stability.csv", keep_default_na=False)
    assert list(table["x"]) == ["hold"] * 3 + ["linear"] * 3
    refused = table[table["y"] == 3]
    assert set(refused["class"]) == {NOT_RUN}
    assert all("not a whole number of steps" in reason for reason in refused["reason"])
    ran = table[table["y"] != 3]
    errors = ran["error_active_stress_mean_kPa"].astype(float)
    assert list(ran["class"]) == [INACCURATE if error > 1.0 else SOUND for error in errors]
    assert {SOUND, INACCURATE} == set(ran["class"])
    for _, row in ran[ran["class"] == INACCURATE].iterrows():
        error = f"{float(row['error_active_stress_mean_kPa']):.3g} kPa"
        assert row["reason"] == f"the error in active_stress_mean_kPa is {error}, the tolerance 1"
    # Cells that differ from their reference in nothing but the step share it: one for held, one for linear inputs.
    assert len(_finished(tmp_path / "out")) == 6
    told = json.loads((tmp_path / "out" / "stability.json").read_text())
    assert told["tolerances"] == {"active_stress_mean_kPa": 1.0}
    assert told["references"] == ["the same with coupling.step_ms=0.25"]
    assert told["counts"] == {kind: int((table["class"] == kind).sum()) for kind in (SOUND, INACCURATE, NOT_RUN)}
    # There is nothing between what was not run and its neighbours.
    assert [crossing["x"] for crossing in told["lines"]["inputs"]["crossings"]] == []


def test_without_a_theory_the_boundary_is_where_cells_are_sound(cell_study: Path, mapped: Mapped) -> None:
    text = cell_study.read_text().replace("[1, 3, 10]", "[0.5, 16]").replace("name: acc", "bisect: 3\nname: acc")
    cell_study.write_text(text.replace("LIMIT", "1.0"))
    with pytest.raises(InputError, match=r"bisect: steps between .* do not divide `run.stop_ms`; give `steps`"):
        mapped(cell_study)
    (panel,) = mapped(_with_parameter_axis(cell_study)).panels
    for crossing in panel.crossings:
        assert (crossing.high - crossing.low) == pytest.approx(0.00004 / 8.0, rel=0.2)
        column = {cell.y: cell for cell in panel.cells if cell.x == crossing.x}
        assert [column[crossing.low].kind, column[crossing.high].kind] == [SOUND, INACCURATE]
        # The error is proportional to what was changed.
        per_change = column[0.00504].errors["active_stress_mean_kPa"] / 0.00004
        assert crossing.low < 0.005 + 1.0 / per_change < crossing.high
    assert len(panel.crossings) == 2
    assert sum(cell.bisected for cell in panel.cells) == 6


def _with_parameter_axis(study: Path) -> Path:
    """How strong the muscle is in place of the step, with a reference of a certain strength."""
    key = "units.active_stress.parameters.tension_per_potential_MPa_per_mV"
    study.write_text(
        f"name: strength\nscenario: small_cell.yaml\nbisect: 3\nreference: {{{key}: 0.005}}\n"
        "tolerances: {active_stress_mean_kPa: 1.0}\nlines:\n  - name: strengths\n    vary:\n"
        f"      coupling.step_ms: [1, 2]\n      {key}: [0.00504, 0.005]\n"
    )
    return study


def test_a_reference_that_fails_leaves_its_cells_unjudged(cell_study: Path, mapped: Mapped) -> None:
    fails = "{coupling.iterate: {max_iterations: 1, converge: {stretch: {relative: 1.0e-12}}}}"
    cell_study.write_text(cell_study.read_text().replace("{coupling.step_ms: 0.25}", fails))
    found = mapped(cell_study)
    for cell in found.cells:
        if cell.y != 3:
            assert cell.kind == SOUND
            assert cell.reason.startswith("not judged for accuracy: its reference failed: the coupling")
            assert not cell.errors
    assert found.notes == ["4 of 6 cells are not judged for accuracy; their reasons say why"]


def test_steps_that_are_accepted_without_having_converged_are_seen(cell_study: Path, mapped: Mapped) -> None:
    iterate = "{max_iterations: 1, on_limit: warn, converge: {stretch: {relative: 1.0e-12}}}"
    cell_study.write_text(
        cell_study.read_text().replace("coupling.interpolation: [hold, linear]", f"coupling.iterate: [null, {iterate}]")
    )
    found = mapped(cell_study)
    kinds = {cell.kind for cell in found.cells if isinstance(cell.x, dict) and cell.y != 3}
    assert kinds == {NOT_CONVERGED}


def test_a_reference_reaches_as_far_as_runs_of_so_many_steps(cell_study: Path, mapped: Mapped, tmp_path: Path) -> None:
    text = cell_study.read_text().replace("[1, 3, 10]", "[1, 2, 3]").replace("name: acc", "steps: 12\nname: acc")
    cell_study.write_text(text)
    found = mapped(cell_study)
    ends = {(cell.x, cell.y): cell.trial.run.end_ms for cell in found.cells if cell.trial is not None}
    assert ends == {(x, y): 12.0 * y for x in ("hold", "linear") for y in (1, 2, 3)}
    assert all("active_stress_mean_kPa" in cell.errors for cell in found.cells)
    # Three lengths, with held and with linear inputs.
    assert len(_finished(tmp_path / "out")) == 12


def test_a_unit_that_dies_is_a_cell(limit_study: Path, bodies: dict[str, Path], mapped: Mapped) -> None:
    limit_study.write_text(
        "name: dies\nscenario: masses.yaml\nlines:\n  - name: bodies\n    vary:\n      coupling.step_ms: [10]\n"
        f"      units.first.fmu: [{bodies['whole']}, {bodies['breaks']}, {bodies['ends']}]\n"
    )
    found = mapped(limit_study)
    assert [cell.kind for cell in found.cells] == [SOUND, UNIT_FAILED, UNIT_FAILED]
    assert "died" in found.cells[1].reason
    assert found.panels[0].crossings == []
