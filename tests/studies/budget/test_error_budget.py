"""If these fail, errors are told of the wrong source, runs are made for nothing, or a failure passes for a number."""

from math import isnan
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.errors import InputError, RunError
from cardiac_cosim.orchestrator.scenario import Scenario
from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.budget import error_budget, sentences
from cardiac_cosim.studies.budget.budget import Budget, Contribution
from cardiac_cosim.studies.budget.runs import Runs
from cardiac_cosim.studies.plan import Variants


def _variants(file: Path, **settings: Any) -> Variants:
    return Variants(file, settings, str(file))


def _inner(scenario: Scenario, name: str, default: float) -> float:
    return float(scenario.units["electrophysiology"].parameters.get(name, default))


def _lawful(scenario: Scenario) -> float:
    """Errors of 0.3 ms by the communication step, -0.8 by the substep, 9 by the inner mesh and 2 by the other one."""
    assert scenario.scene is not None
    step, substep = scenario.coupling.step_ms, _inner(scenario, "longest_substep_ms", 0.25) / 0.25
    outer, inner = scenario.scene.refine, scenario.scene.refine + _inner(scenario, "refine", 0)
    return 100.0 + 0.3 * step - 0.8 * substep**2 + 9.0 * 0.25**inner + 2.0 * 0.5**outer


def _by_source(budget: Budget) -> dict[str, Contribution]:
    (quantity,) = budget.quantities
    return {each.source: each for each in quantity.contributions}


def test_each_source_gets_its_own_error(strand: Path, runner: Any) -> None:
    bench = runner(_lawful)
    budget = error_budget(_variants(strand), bench)
    found = _by_source(budget)
    errors = {name: (each.trusted, each.estimate, each.order) for name, each in found.items()}
    assert errors == {
        "communication step": (True, pytest.approx(0.3), pytest.approx(1.0)),
        "electrophysiology sub-step": (True, pytest.approx(-0.8), pytest.approx(2.0)),
        "electrophysiology mesh": (True, pytest.approx(9.0), pytest.approx(2.0)),
        "mechanics mesh": (True, pytest.approx(2.0), pytest.approx(1.0)),
    }
    assert all(each.value == pytest.approx(110.5) for each in found.values())
    assert sentences(budget) == [
        "activation at near: 110 ms ± 12; the electrophysiology mesh contributes 9, the mechanics mesh 2, "
        "the electrophysiology sub-step 0.8 and the communication step 0.3"
    ]


def test_where_coarser_runs_make_the_order_clear_no_run_is_made_four_times_finer(strand: Path, runner: Any) -> None:
    bench = runner(_lawful)
    error_budget(_variants(strand), bench)
    assert {"coupling.step_ms": 0.5} in bench.ran
    assert {"coupling.step_ms": 0.25} not in bench.ran
    # Meshes cannot be coarser than they are.
    assert {"scene.refine": 2} in bench.ran
    assert [each for each in bench.ran if bench.ran.count(each) > 1] == []
    unclear = runner(lambda scenario: 100.0 + 0.3 * scenario.coupling.step_ms**1.5)
    found = _by_source(error_budget(_variants(strand), unclear))
    assert {"coupling.step_ms": 0.25} in unclear.ran
    assert found["communication step"].estimate == pytest.approx(0.3)


def test_runs_that_would_take_too_long_are_not_made_and_not_trusted(strand: Path, runner: Any) -> None:
    def seconds(scenario: Scenario) -> float:
        assert scenario.scene is not None
        return float(3.0 * 15.0**scenario.scene.refine)

    # The finest would take 675 s, and 0.1 + 3.2 s of its own.
    bench = runner(_lawful, seconds)
    others = _by_source(error_budget(_variants(strand), bench))["mechanics mesh"]
    assert {"scene.refine": 2} not in bench.ran
    assert not others.trusted
    assert others.estimate == pytest.approx(1.0)
    assert "scene.refine=2" in others.reason
    assert "about 11 minutes" in others.reason
    assert others.finer == "scene.refine=1 against units.electrophysiology.parameters.refine=1"
    quick = runner(_lawful, lambda scenario: 0.8 * seconds(scenario))
    assert _by_source(error_budget(_variants(strand), quick))["mechanics mesh"].trusted


def test_a_run_that_fails_takes_its_source_only(strand: Path, runner: Any) -> None:
    bench = runner(_lawful, failing=lambda scenario: "it diverged" if scenario.coupling.step_ms == 0.5 else "")
    budget = error_budget(_variants(strand), bench)
    found = _by_source(budget)
    step = found.pop("communication step")
    assert not step.trusted
    assert isnan(step.estimate)
    assert "it diverged" in step.reason
    assert "coupling.step_ms=0.5" in step.reason
    assert all(each.trusted for each in found.values())
    assert "(unknown: communication step)" in sentences(budget)[0]


def test_a_coarser_run_that_fails_is_made_up_for_by_a_finer_one(strand: Path, runner: Any) -> None:
    bench = runner(_lawful, failing=lambda scenario: "it diverged" if scenario.coupling.step_ms == 2.0 else "")
    step = _by_source(error_budget(_variants(strand), bench))["communication step"]
    assert {"coupling.step_ms": 0.25} in bench.ran
    assert step.trusted
    assert step.estimate == pytest.approx(0.3)


def test_a_probe_that_the_finer_run_does_not_activate_has_no_error_bar(strand: Path, runner: Any) -> None:
    bench = runner(lambda scenario: None if scenario.coupling.step_ms == 0.5 else _lawful(scenario))
    step = _by_source(error_budget(_variants(strand), bench))["communication step"]
    assert not step.trusted
    assert "the run with coupling.step_ms=0.5 has no activation_near_ms" in step.reason


def test_a_source_that_cannot_be_finer_says_why(strand: Path, runner: Any) -> None:
    variants = _variants(strand, **{"units.electrophysiology.parameters.longest_substep_ms": 1e-4})
    substep = _by_source(error_budget(variants, runner(lambda scenario: 1.0)))["electrophysiology sub-step"]
    assert not substep.trusted
    assert isnan(substep.estimate)
    assert "longest_substep_ms" in substep.reason


def test_without_a_run_of_the_scenario_itself_there_is_no_budget(strand: Path, runner: Any) -> None:
    bench = runner(_lawful, failing=lambda scenario: "unit 'x' failed")
    with pytest.raises(RunError, match="unit 'x' failed"):
        error_budget(_variants(strand), bench)
    assert bench.ran == [{}]
    with pytest.raises(InputError, match="records no number"):
        error_budget(_variants(strand), runner(lambda scenario: None))


@pytest.mark.long
def test_what_is_trusted_is_within_a_factor_of_two_of_a_run_four_times_finer(strand: Path, tmp_path: Path) -> None:
    # The physics itself, and the yardstick of the whole: each run is made, whether the budget needed it or not.
    sets: dict[str, Any] = {"coupling.iterate": {"converge": {"stretch": {"relative": 0.01}}}}
    trusted = set()
    for number, common in enumerate(({}, sets)):
        variants = _variants(strand, **common)
        with Bench(tmp_path / str(number)) as bench:
            budget = error_budget(variants, bench)
            runs = Runs(variants, bench)
            base = runs.base().values
            runs.run([each for source in budget.sources for at in source.levels.values() for each in at.runs], "")
        levels = {source.name: source.levels for source in budget.sources}
        for quantity in budget.quantities:
            assert quantity.value == base[quantity.name]
            for each in quantity.contributions:
                if not each.trusted:
                    assert each.reason
                    continue
                begin, finest = levels[each.source][0], levels[each.source][2]
                apart = runs[begin.settings].values[quantity.name] - runs[finest.settings].values[quantity.name]
                if finest.beside is not None:
                    apart += runs[finest.beside].values[quantity.name] - base[quantity.name]
                assert 0.5 <= each.estimate / apart <= 2.0, each
                trusted.add(each.source)
    assert {"communication step", "electrophysiology sub-step"} <= trusted
