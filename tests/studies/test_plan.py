"""If these fail, a study runs other points than were asked for, or its mistakes come out after hours, or not at all."""

from collections.abc import Callable
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.studies.plan import combinations, plan_study

_HELD = "vary: {coupling.step_ms: [0.5, 1, 2, 4]}"

#: What is put in the place of what, and words of the message.
_MISTAKES: dict[str, tuple[str, str, list[str]]] = {
    "unknown key in vary": (_HELD, "vary: {coupling.step: [1]}", ["lines, 'held'", "coupling.step", "'step_ms'?"]),
    "unknown section": (_HELD, "vary: {coupel.step_ms: [1]}", ["lines, 'held'", "'coupel'", "'coupling'?"]),
    "unknown unit": (_HELD, "vary: {units.fibres.parameters.apex_z_mm: [-1]}", ["no unit 'fibres'", "'fibers'?"]),
    "unknown parameter": (
        _HELD,
        "vary: {units.mechanics.parameters.hold_: [free]}",
        ["lines, 'held'", "no parameter 'hold_'", "'hold'?"],
    ),
    "value of the wrong type": (_HELD, "vary: {coupling.step_ms: [long]}", ["'coupling.step_ms' is 'long'", "number"]),
    "parameter out of range": (
        _HELD,
        "vary: {units.electrophysiology.parameters.longest_substep_ms: [-1]}",
        ["longest_substep_ms", "-1", "expected"],
    ),
    "empty list": (_HELD, "vary: {coupling.step_ms: []}", ["vary.coupling.step_ms", "[]"]),
    "no list": (_HELD, "vary: {coupling.step_ms: 1}", ["vary.coupling.step_ms", "list"]),
    "both set and varied": (_HELD, f"set: {{coupling.step_ms: 1}}\n    {_HELD}", ["'coupling.step_ms'", "`vary`"]),
    "no valid point": (_HELD, "vary: {coupling.step_ms: [3, 7]}", ["none of its points", "whole number of steps"]),
    "two lines of a name": ("name: linear", "name: held", ["'held'", "rename"]),
    "no lines": ("lines:", "lines: []\nrest:", ["'lines' is []"]),
    "unknown key of the study": ("measures:", "measure:", ["unknown key 'measure'", "'measures'?"]),
    "no reference": ("reference: {coupling.step_ms: 0.25}", "set: {}", ["'reference' is missing"]),
    "empty reference": ("{coupling.step_ms: 0.25}", "{}", ["reference", "finer"]),
    "three references": ("{coupling.step_ms: 0.25}", "[{run.stop_ms: 1}, {run.stop_ms: 2}, {run.stop_ms: 4}]", ["two"]),
    "results and settings": (
        "{coupling.step_ms: 0.25}",
        "{results: x, run.stop_ms: 20}",
        ["cannot be combined with settings"],
    ),
    "reference that cannot be": ("{coupling.step_ms: 0.25}", "{coupling.step_ms: 0.3}", ["reference", "0.3"]),
    "no scenario": ("small_cell.yaml", "large_cell.yaml", ["large_cell.yaml: no such scenario file"]),
}


@pytest.mark.parametrize("mistake", _MISTAKES)
def test_a_mistake_is_told_before_anything_runs_with_file_key_and_remedy(mistake: str, study: Path) -> None:
    before, after, words = _MISTAKES[mistake]
    text = study.read_text()
    assert before in text
    study.write_text(text.replace(before, after))
    with pytest.raises(InputError) as problem:
        plan_study(study)
    message = str(problem.value)
    assert message.startswith(f"{study}: ")
    for word in words:
        assert word in message
    assert not (study.parent / "out").exists()


def test_settings_of_a_line_win_over_those_of_the_study_and_of_the_command(study: Path) -> None:
    study.write_text(study.read_text().replace("measures:", "set: {run.stop_ms: 80, output.every_ms: 40}\nmeasures:"))
    plan = plan_study(study, ["run.stop_ms=160", "coupling.step_ms=0.5"])
    steps = [point.scenario.coupling.step_ms for point in plan.points]
    assert steps == [0.5, 1, 2, 4, 1, 2, 4]
    assert {point.scenario.run.stop_ms for point in plan.points} == {160}
    assert {point.scenario.output.every_ms for point in plan.points} == {40}
    assert [point.scenario.coupling.extrapolation for point in plan.points] == [0] * 4 + [1] * 3
    reference = plan.references[0].point
    assert reference is not None
    assert (reference.scenario.coupling.step_ms, reference.scenario.run.stop_ms) == (0.25, 160)


def test_several_keys_give_their_product() -> None:
    assert combinations({"a": [1, 2], "b": ["x", "y", "z"]}) == [
        {"a": a, "b": b} for a in (1, 2) for b in ("x", "y", "z")
    ]
    assert combinations({}) == [{}]


def test_settings_that_cannot_stand_together_are_a_point_with_a_reason(study: Path) -> None:
    study.write_text(study.read_text().replace("[0.5, 1, 2, 4]", "[0.5, 3]"))
    first, second = plan_study(study).lines["held"]
    assert (first.point is not None, second.point) == (True, None)
    assert second.reason.startswith("`run.stop_ms` (40 ms) is not a whole number of steps")


def test_a_point_is_known_by_its_scenario_files_and_program_alone(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def keys() -> list[str]:
        return [point.key for point in plan_study(study).points]

    before = keys()
    assert len(set(before)) == 7
    # The study may say it in another way: only the scenario that comes of it counts.
    study.write_text(
        study.read_text().replace("name: held", "name: other").replace("measures: [stretch, ", "measures: [")
    )
    assert keys() == before
    monkeypatch.setattr("cardiac_cosim.orchestrator.results.origin.program", lambda: "another")
    assert not set(keys()) & set(before)


def test_a_point_is_another_when_a_file_it_names_is(
    study: Path, tmp_path: Path, make_signals: Callable[[str], None]
) -> None:
    make_signals("0,1\n40,1\n")
    before = [point.key for point in plan_study(study).points]
    make_signals("0,1\n40,1.1\n")
    assert not {point.key for point in plan_study(study).points} & set(before)


@pytest.fixture
def make_signals(study: Path, tmp_path: Path) -> Callable[[str], None]:
    """Lets the scenario name a file of signals, whose rows the test gives."""
    scenario = tmp_path / "small_cell.yaml"
    scenario.write_text(scenario.read_text() + "inputs: {file: signals.csv}\n")

    def write(rows: str) -> None:
        (tmp_path / "signals.csv").write_text(f"time_ms,stretch\n{rows}")

    return write


def test_so_many_steps_are_runs_of_many_lengths_and_a_reference_as_long_as_the_longest(study: Path) -> None:
    text = study.read_text().replace("name: steps", "name: steps\nsteps: 6")
    study.write_text(
        text.replace("[0.5, 1, 2, 4]", "[0.1, 0.3, 4]").replace("{coupling.step_ms: 0.25}", "{coupling.step_ms: 0.05}")
    )
    plan = plan_study(study)
    assert [point.scenario.run.stop_ms for point in plan.points] == [0.6, 1.8, 24, 6, 12, 24]
    assert [point.scenario.output.every_ms for point in plan.points] == [0.6, 1.8, 24, 6, 12, 24]
    reference = plan.references[0].point
    assert reference is not None
    # It has outputs when any of them ends.
    assert (reference.scenario.run.stop_ms, reference.scenario.output.every_ms) == (24, 0.6)
    assert reference.scenario.coupling.step_ms == 0.05


def test_adaptive_coupling_has_no_number_of_steps(study: Path) -> None:
    text = study.read_text().replace("name: steps", "name: steps\nsteps: 6")
    study.write_text(text.replace("name: linear\n    set: {", "name: linear\n    set: {coupling.adaptive: {}, "))
    with pytest.raises(InputError, match=r"lines, 'linear'.*`steps` counts .* `coupling.adaptive` .*; remove one"):
        plan_study(study)
