"""If these fail, a map runs other cells than were asked for, or a mistake in its study comes out after hours."""

from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.studies.stability import plan_map
from cardiac_cosim.studies.stability.axis import Axis

_STEPS = "coupling.step_ms: [20, 50, 110, 250]"
_STIFF = "units.second.parameters.k_c: [10, 20]"

#: What is put in the place of what, and words of the message.
_MISTAKES: dict[str, tuple[str, str, list[str]]] = {
    "one axis": (_STIFF, "", ["lines, 'held'", "`vary` has 1 keys", "exactly two", "`set`"]),
    "length and steps": ("steps: 200", "steps: 200\nset: {run.stop_ms: 9}", ["'run.stop_ms'", "`steps` decides it"]),
    "three axes": (_STEPS, f"{_STEPS}\n      coupling.scheme: [jacobi]", ["lines, 'held'", "3 keys"]),
    "a value twice": ("[10, 20]", "[10, 10.0]", ["k_c' has the value 10 twice", "remove one"]),
    "adaptive coupling": ("steps: 200", "steps: 200\nset: {coupling.adaptive: {}}", ["`coupling.adaptive`", "remove"]),
    "no steps": ("steps: 200\n", "", ["bisect", "do not divide", "give `steps`"]),
    "unknown theory": ("theory: masses", "theory: massses", ["theory", "'massses'", "did you mean 'masses'?"]),
    "tolerance alone": ("theory: masses", "tolerances: {x: 1}", ["`tolerances`", "`reference`"]),
    "tolerance of nothing": ("theory: masses", "tolerances: {x: 0}", ["tolerances.x", "greater than 0"]),
    "unknown key": ("theory: masses", "theories: masses", ["unknown key 'theories'", "'theory'?"]),
    "unknown growth": ("growth: modes", "growth: mode", ["'growth'", "'modes'?"]),
    "wrong reference": ("theory: masses", "reference: {coupling.stp_ms: 1}", ["coupling.stp_ms", "'step_ms'?"]),
}


@pytest.mark.parametrize("mistake", _MISTAKES)
def test_a_mistake_is_told_before_anything_runs_with_file_key_and_remedy(mistake: str, limit_study: Path) -> None:
    before, after, words = _MISTAKES[mistake]
    text = limit_study.read_text()
    assert before in text
    limit_study.write_text(text.replace(before, after))
    with pytest.raises(InputError) as problem:
        plan_map(limit_study)
    message = str(problem.value)
    assert message.startswith(f"{limit_study}: ")
    for word in words:
        assert word in message


def test_x_comes_first_and_every_run_has_its_steps(limit_study: Path) -> None:
    (grid,) = plan_map(limit_study, ["coupling.extrapolation=1"]).grids
    assert (grid.x.key, grid.y.key) == ("units.second.parameters.k_c", "coupling.step_ms")
    assert [(place.x, place.y) for place in grid.places] == [(x, y) for x in (10, 20) for y in (20, 50, 110, 250)]
    for place in grid.places:
        assert place.point is not None
        scenario = place.point.scenario
        assert scenario.run.stop_ms == scenario.output.every_ms == 200 * place.y
        assert scenario.coupling.extrapolation == 1


def test_steps_are_counted_without_rounding(limit_study: Path) -> None:
    text = limit_study.read_text().replace("steps: 200", "steps: 3").replace("[20, 50, 110, 250]", "[0.1, 0.7, 1.1]")
    limit_study.write_text(text)
    (grid,) = plan_map(limit_study).grids
    assert [place.point.scenario.run.stop_ms for place in grid.places if place.point] == 2 * [0.3, 2.1, 3.3]


def test_a_reference_is_the_cell_itself_with_other_settings(limit_study: Path) -> None:
    text = limit_study.read_text()
    limit_study.write_text(
        text.replace("theory: masses", "reference: {coupling.step_ms: 5}").replace("steps: 200\n", "")
    )
    limit_study.write_text(
        limit_study.read_text().replace("bisect: 4\n", "").replace("[20, 50, 110, 250]", "[20, 40, 30]")
    )
    (grid,) = plan_map(limit_study).grids
    keys: dict[float, set[str]] = {10: set(), 20: set()}
    for place in grid.places:
        if place.y == 30:
            # It does not divide the run.
            assert (place.point, place.reference) == (None, None)
            assert "not a whole number of steps" in place.reason
            continue
        assert not isinstance(place.reference, str)
        assert place.reference is not None
        assert place.reference.point is not None
        reference = place.reference.point.scenario
        assert (reference.coupling.step_ms, reference.run.stop_ms) == (5, 200)
        assert reference.units["second"].parameters["k_c"] == place.x
        keys[place.x].add(place.reference.point.key)
    # Cells that differ in the step alone share it.
    assert [len(shared) for shared in keys.values()] == [1, 1]


def test_a_reference_that_cannot_be_run_leaves_the_cell(limit_study: Path) -> None:
    limit_study.write_text(limit_study.read_text().replace("theory: masses", "reference: {coupling.step_ms: 7}"))
    (grid,) = plan_map(limit_study).grids
    for place in grid.places:
        assert place.point is not None
        assert isinstance(place.reference, str)
        assert "its reference cannot be run: `run.stop_ms`" in place.reference


def test_whole_numbers_have_whole_numbers_between_them(limit_study: Path) -> None:
    limit_study.write_text(limit_study.read_text().replace(_STEPS, "units.second.every: [1, 8]"))
    plan = plan_map(limit_study)
    (grid,) = plan.grids
    place = plan.between(grid, 10, 4.5)
    assert place is not None
    assert (place.y, place.bisected) == (4, True)
    assert plan.between(grid, 10, 0.2) is None


@pytest.mark.parametrize(
    ("values", "numeric", "geometric", "middle"),
    [
        ([1, 2, 4], True, False, 1.5),
        ([1, 2, 40], True, True, 1.41421),
        ([0.0, 1, 40], True, False, 0.5),
        ([-1, 1], True, False, 0.0),
        ([True, False], False, False, None),
        (["a", "b"], False, False, None),
        ([None, {"a": 1}], False, False, None),
    ],
)
def test_what_lies_between_two_values(
    values: list[object], numeric: bool, geometric: bool, middle: float | None
) -> None:
    axis = Axis("key", values)
    assert (axis.is_numeric, axis.is_geometric) == (numeric, geometric)
    if middle is not None:
        assert axis.between(*axis.rising[:2]) == middle
        refined = axis.refined(3)
        assert len(refined) == 3 * len(values) - 2
        assert set(axis.rising) <= set(refined)
        assert (refined[1:] > refined[:-1]).all()
        assert len(axis.spread(41)) >= 41
