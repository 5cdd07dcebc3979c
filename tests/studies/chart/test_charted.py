"""If these fail, a chart recommends a setting that another one beats, or shows orders that nobody observed."""

import json
from collections.abc import Callable
from itertools import pairwise
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.studies.chart import write_chart
from cardiac_cosim.studies.chart.front import on_front
from cardiac_cosim.studies.order import observed_order, step_of
from hypothesis import given
from hypothesis import strategies as st

_NUMBERS = st.lists(st.tuples(st.integers(1, 6), st.integers(0, 6) | st.just(inf)), min_size=1, max_size=12)


@given(_NUMBERS)
def test_the_front_is_what_nobody_beats(points: list[tuple[float, float]]) -> None:
    costs, errors = zip(*points, strict=True)
    on = on_front(costs, errors)
    for (cost, error), is_on in zip(points, on, strict=True):
        beaten = any(c <= cost and e <= error and (c < cost or e < error) for c, e in points)
        assert is_on == (error < inf and not beaten)
    assert any(on) == any(error < inf for error in errors)


def test_what_has_no_error_is_on_no_front() -> None:
    assert on_front([1.0, 2.0], [nan, 3.0]) == [False, True]


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 3.0])
def test_the_order_is_the_power_of_the_step(order: float) -> None:
    steps = [0.5, 1.0, 2.0, 5.0]
    assert observed_order(steps, [7.0 * step**order for step in steps]) == pytest.approx(order)
    # What the reference errs by itself says nothing of an order.
    floor = [max(7.0 * step**order, 6.9) for step in steps]
    assert observed_order(steps, [*floor[:1], 6.9, *floor[2:]], above=7.5) is None


def test_two_errors_have_no_order() -> None:
    assert observed_order([1.0, 2.0], [1.0, 2.0]) is None
    assert observed_order([1.0, 2.0, 4.0], [1.0, 2.0, inf]) is None
    assert observed_order([1.0, 2.0, 4.0], [0.0, 1.0, 2.0]) is None
    assert observed_order([None, 1.0, 2.0], [1.0, 1.0, 2.0]) is None


def test_the_step_is_the_one_number_that_varies() -> None:
    assert step_of({"coupling.step_ms": 2.5}) == 2.5
    assert step_of({"units.electrophysiology.parameters.refine": 2}) == 0.25
    assert step_of({"scene.refine": 0}) == 1.0
    assert step_of({"coupling.step_ms": 2.5, "coupling.scheme": "jacobi"}) is None
    assert step_of({"coupling.scheme": "jacobi"}) is None
    assert step_of({"a": True}) is None
    assert step_of({}) is None


def test_every_point_has_its_errors_costs_and_counts(steps: Any, tmp_path: Path) -> None:
    chart = steps.chart
    write_chart(chart, tmp_path)
    table = pandas.read_csv(tmp_path / "chart.csv")
    assert list(table["line"]) == ["held"] * 4 + ["linear"] * 3
    assert list(table["coupling.step_ms"]) == [0.5, 1, 2, 4, 1, 2, 4]
    assert set(table["status"]) == {"done"}
    for step, solves, sweeps, count in zip(
        table["coupling.step_ms"], table["solves_mechanics"], table["sweeps"], table["runs"], strict=True
    ):
        assert solves == sweeps == 40 / step
        assert 1 <= count <= 3
    units = ["fibers", "electrophysiology", "active_stress", "mechanics"]
    assert (table["cpu_s"] >= table[[f"cpu_s_{unit}" for unit in units]].sum(axis=1)).all()
    assert (table["wall_s"] > 0.0).all()
    # The errors are those of the results that lie there, and fall with the step.
    reference = simulate(steps.study.with_name("small_cell.yaml"), {"coupling.step_ms": 0.25}, tmp_path / "reference")
    last = reference.frame("stretch", -1)
    for folder, error in zip(table["folder"], table["error_stretch"], strict=True):
        run = StoredRun(steps.output / "points" / folder)
        apart = [abs(run.frame("stretch", number) - reference.frame("stretch", number)).max() for number in range(3)]
        assert error == pytest.approx(max(apart))
    assert last is not None
    held = list(table["error_active_stress_kPa"])[:4]
    assert all(finer < coarser for finer, coarser in pairwise(held))
    assert chart.lines[0].orders["active_stress_kPa"] == pytest.approx(1.0, abs=0.4)


def test_the_front_in_the_table_is_that_of_its_numbers(steps: Any, tmp_path: Path) -> None:
    write_chart(steps.chart, tmp_path)
    table = pandas.read_csv(tmp_path / "chart.csv")
    for measure in ("stretch", "active_stress_kPa"):
        assert list(table[f"front_{measure}"]) == on_front(list(table["wall_s"]), list(table[f"error_{measure}"]))


def test_two_references_tell_how_far_they_are_to_be_trusted(steps: Any, tmp_path: Path) -> None:
    simulate(steps.study.with_name("small_cell.yaml"), {"coupling.step_ms": 0.25}, tmp_path / "kept")
    references = f"[{{results: {tmp_path / 'kept'}}}, {{coupling.step_ms: 0.5}}]"
    chart = steps.again(steps.study.read_text().replace("{coupling.step_ms: 0.25}", references))
    write_chart(chart, tmp_path)
    # The second one is the first point of the first line.
    assert chart.uncertainty == chart.lines[0].rows[0].errors
    told = json.loads((tmp_path / "chart.json").read_text())
    assert told["uncertainty"] == chart.uncertainty
    assert [text.partition(":")[0] for text in told["reference"]] == ["results", "coupling.step_ms=0.5"]
    assert {"processor", "cores"} <= told["machine"].keys()
    assert "numpy" in told["versions"]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("[stretch, ", "[strech, ", ["measures", "'strech'", "'stretch'?"]),
        ("[stretch, ", "[lv_volume_ml, ", ["measures", "'lv_volume_ml'", "never changes"]),
        ("{coupling.step_ms: 0.25}", "{results: nowhere}", ["reference", "nowhere", "cosim run"]),
        (
            "{coupling.step_ms: 0.25}",
            "{coupling.iterate: {max_iterations: 1, converge: {stretch: {relative: 1.0e-12}}}}",
            ["reference", "this run failed", "no convergence", "change `reference`"],
        ),
    ],
)
def test_a_reference_or_a_measure_that_is_none_is_told(before: str, after: str, words: list[str], steps: Any) -> None:
    text = steps.study.read_text()
    assert before in text
    with pytest.raises(InputError) as problem:
        steps.again(text.replace(before, after))
    message = str(problem.value)
    assert message.startswith(f"{steps.study.with_name('again.yaml')}: ")
    for word in words:
        assert word in message


def test_without_measures_all_that_moves_is_measured(steps: Any) -> None:
    chart = steps.again(steps.study.read_text().replace("measures: [stretch, active_stress_kPa]\n", ""))
    names = [measure.name for measure in chart.measures]
    assert names == [
        "activation_ms",
        "potential_cell_mV",
        "active_stress_mean_kPa",
        "active_stress_kPa",
        "potential_mV",
        "stretch",
    ]


def test_errors_on_another_mesh_are_told_where_they_can_be(
    study: Path, tmp_path: Path, charted: Callable[..., Any]
) -> None:
    strand = (tmp_path / "small_cell.yaml").read_text().replace("geometry: cell", "geometry: strand, mesh_size_mm: 4")
    (tmp_path / "small_cell.yaml").write_text(strand)
    study.write_text(
        "name: meshes\nscenario: small_cell.yaml\nreference: {scene.refine: 2}\n"
        "lines: [{name: sizes, vary: {scene.mesh_size_mm: [4, 3]}}, {name: nested, vary: {scene.refine: [1]}}]\n"
    )
    chart = charted(study)
    names = [measure.name for measure in chart.measures]
    assert "potential_mV" in names
    assert "stretch" not in names
    assert any("stretch" in note for note in chart.notes)
    same, other, nested = chart.rows
    assert np.isfinite([same.errors["potential_mV"], nested.errors["potential_mV"]]).all()
    assert "potential_mV" not in other.errors
    assert "another mesh" in other.reason
    assert np.isfinite(other.errors["potential_cell_mV"])
