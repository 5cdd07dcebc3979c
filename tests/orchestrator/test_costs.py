"""If these fail, a chart of cost against accuracy compares numbers that nobody has counted."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.acceleration import Relaxation
from cardiac_cosim.orchestrator.coupling.connections import connect
from cardiac_cosim.orchestrator.coupling.convergence import Criterion
from cardiac_cosim.orchestrator.coupling.exchange import Exchange, Inputs
from cardiac_cosim.orchestrator.coupling.iteration import Iterated, Limits
from cardiac_cosim.orchestrator.coupling.master import Accepted, Master
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES
from cardiac_cosim.orchestrator.coupling.step_control import AdaptiveStep, FixedStep, Verdict
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.participant import Abilities, Participant, Ports
from cardiac_cosim.orchestrator.participants.recipe import Recipe
from cardiac_cosim.orchestrator.participants.workers import Workers
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario


class _Watch:
    def __init__(self) -> None:
        self.steps: list[Accepted] = []

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        self.steps.append(step)


def _asked(units: dict[str, Any]) -> dict[str, int]:
    """What the units themselves remember of the steps that they were asked to take."""
    return {name: sum(call[1] == "step" for call in unit.calls) for name, unit in units.items()}


def _loop(fake: Any, port: Any) -> dict[str, Any]:
    """A source, and a loop x = 1 + x / 2 of two units after it."""
    return {
        "source": fake("source", outputs=[port("s")], law=lambda given, before, time, size: {"s": time}),
        "a": fake("a", [port("s"), port("x")], [port("y")], law=lambda given, *_: {"y": 1.0 + 0.5 * given["x"]}),
        "b": fake("b", [port("y")], [port("x")], law=lambda given, *_: {"x": given["y"]}),
    }


def _iterated(units: dict[str, Any], limit: int = 99, control: Any = None, steps: int = 3) -> Master:
    links = connect(units, [])
    limits = Limits({"b.x": Criterion(absolute=1e-6)}, limit, True)
    scheme = Iterated(SCHEMES["gauss-seidel"](), units, links, Relaxation(1.0), limits)
    return Master(units, links, scheme, Timeline.of_fixed_step(1.0, steps, 1.0), control=control)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_an_explicit_step_is_one_sweep_and_one_solve_of_each_unit_that_is_due(
    fake: Any, port: Any, master: Any, scheme: str
) -> None:
    units = {"a": fake("a", outputs=[port("x")]), "b": fake("b", [port("x")], [port("y")])}
    units["static"] = fake("static", outputs=[port("f", fixed=True)])
    run = master(units, steps=10, scheme=scheme, every={"b": 4}, every_ms=5.0)
    run.run([])
    # At the fourth exchange, and at the outputs after the fifth and the tenth.
    assert {name: run.solves[name] for name in units} == {"a": 10, "b": 4, "static": 0} == _asked(units)
    assert run.sweeps == 10


def test_each_sweep_of_an_iterated_step_counts(fake: Any, port: Any) -> None:
    units, watch = _loop(fake, port), _Watch()
    run = _iterated(units)
    run.run([watch])
    needed = [step.sweeps.iterations for step in watch.steps[1:]]
    assert max(needed) > 10
    assert run.sweeps == sum(needed)
    assert run.solves == {"source": 3, "a": sum(needed), "b": sum(needed)} == _asked(units)


def test_sweeps_that_came_to_nothing_count_as_well(fake: Any, port: Any) -> None:
    units = _loop(fake, port)
    run = _iterated(units, limit=4)
    with pytest.raises(RunError, match="no convergence in 4 sweeps"):
        run.run([])
    assert run.sweeps == 4
    assert run.solves == {"source": 1, "a": 4, "b": 4} == _asked(units)


class _RefusesOnce(FixedStep):
    """Refuses every step once."""

    refuses = True
    again = False

    def judge(self, exchange: Exchange, ticks: int) -> Verdict:
        self.again = not self.again
        return Verdict(not self.again)


def test_sweeps_of_refused_steps_count_as_often_as_they_were_made(fake: Any, port: Any) -> None:
    units, watch = _loop(fake, port), _Watch()
    run = _iterated(units, control=_RefusesOnce())
    run.run([watch])
    assert [step.rejected for step in watch.steps[1:]] == [1, 1, 1]
    # A step that is repeated as it was needs the same sweeps again.
    assert run.sweeps == 2 * sum(step.sweeps.iterations for step in watch.steps[1:])
    assert run.solves == {"source": 6, "a": run.sweeps, "b": run.sweeps} == _asked(units)


@pytest.mark.parametrize("scheme", ["gauss-seidel", "jacobi"])
def test_units_that_failed_or_stepped_beside_one_that_did_were_asked_all_the_same(
    fake: Any, port: Any, scheme: str
) -> None:
    def fails(given: Any, before: Any, time: float, size: float) -> dict[str, Any]:
        if size > 0.002:
            raise ParticipantError("too long for me")
        return {"y": time}

    units = {
        "a": fake("a", outputs=[port("x")], law=lambda given, before, time, size: {"x": time}),
        "b": fake("b", [port("x")], [port("y")], law=fails),
        "c": fake("c", [port("y")], [port("z")]),
    }
    times, watch = Timeline.of_shortest_step(1.0, 16.0, 16.0), _Watch()
    control = AdaptiveStep(times, 0.5, 1.0, 16.0, 8.0, units)
    run = Master(units, connect(units, []), SCHEMES[scheme](), times, inputs=Inputs(1, True, 2), control=control)
    run.run([watch])
    taken, refused = len(watch.steps) - 1, sum(step.rejected for step in watch.steps)
    assert refused >= 2
    assert run.sweeps == taken + refused
    assert run.solves == _asked(units)
    # Under Gauss–Seidel the one after the unit that failed was not asked any more.
    assert run.solves == {"a": run.sweeps, "b": run.sweeps, "c": run.sweeps if scheme == "jacobi" else taken}


def test_a_run_that_goes_on_counts_on(fake: Any, port: Any) -> None:
    class Stop(_Watch):
        def __bool__(self) -> bool:
            return len(self.steps) == 3

    whole, first, second = (_iterated(_loop(fake, port), control=_RefusesOnce(), steps=5) for _ in range(3))
    whole.run([])
    stop = Stop()
    first.run([stop], stop=stop)
    second.resume(first.memory())
    second.run([])
    assert (second.solves, second.sweeps) == (whole.solves, whole.sweeps)


@pytest.mark.parametrize("participants", ["native", "fmu"])
def test_mechanics_that_nobody_reads_costs_a_solve_per_output(
    small_scenario: Path, tmp_path: Path, participants: str
) -> None:
    sets = ["units.electrophysiology.parameters.stretch_conductance=0", f"run.participants={participants}"]
    outcome = run_scenario(load_scenario(small_scenario, sets), tmp_path, tmp_path / "out", fmu_dir=tmp_path)
    stepped = {"fibers": 0, "electrophysiology": 10, "active_stress": 10, "mechanics": 2}
    assert outcome.summary["solves"] == stepped
    assert outcome.summary["sweeps"] == 10


@pytest.mark.parametrize("where", ["threads", "processes"])
def test_the_cpu_time_of_a_unit_that_works_elsewhere_is_charged_to_it(where: str) -> None:
    # Defined in here, it is sent to processes that have no such module.
    class Burner:
        """Computes for 0.1 s of the CPU at its initialisation, and 0.2 s in each step, in its own thread."""

        def __init__(self) -> None:
            self.name = "burner"
            self.inputs, self.outputs, self.observed = Ports(), Ports(), Ports()
            self.abilities = Abilities()

        def burn(self, seconds: float) -> None:
            end = time.thread_time() + seconds
            while time.thread_time() < end:
                pass

        def begin(self) -> None:
            self.burn(0.05)

        def complete(self) -> None:
            self.burn(0.05)

        def start(self, begin: float, size: float) -> Any:
            self.burn(0.2)
            if begin > 0.0015:
                raise ParticipantError("burnt out")
            return lambda: None

        def close(self) -> None:
            pass

    class Burns(Recipe):
        def make(self) -> Participant:
            return Burner()  # type: ignore[return-value]

    with Workers(where, 1, None) as workers:
        units = {"burner": workers.make(Burns("burner"))}
        run = Master(units, (), SCHEMES["jacobi"](), Timeline.of_fixed_step(1.0, 3.0, 1.0))
        begin = time.process_time()
        with pytest.raises(RunError, match="burnt out"):
            run.run([])
        here = time.process_time() - begin
    # Two steps, and a third that failed.
    assert 0.7 <= run.watch.cpu["burner"] < 1.4
    # What threads of this process used is in the time of the process already.
    assert run.watch.cpu_apart == (run.watch.cpu["burner"] if where == "processes" else 0.0)
    assert run.watch.cpu["burner"] <= here + run.watch.cpu_apart


def test_the_cpu_time_of_all_processes_that_worked_on_a_run_adds_up(
    small_scenario: Path, tmp_path: Path, stopped: Any
) -> None:
    scenario = load_scenario(small_scenario, ["run.stop_ms=4", "run.checkpoint_every=1", "run.workers=processes"])
    stopped(3, scenario, tmp_path, tmp_path / "out")
    before = _cpu(tmp_path / "out")
    after = run_scenario(scenario, tmp_path, tmp_path / "out", resume=True).summary["cpu_s"]
    for unit, seconds in before["units"].items():
        assert after["units"][unit] > seconds > 0.0
    assert after["total"] > before["total"]
    for cpu in (before, after):
        assert np.sum(list(cpu["units"].values())) <= cpu["total"]


def _cpu(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "summary.json").read_text())["cpu_s"]
    return found
