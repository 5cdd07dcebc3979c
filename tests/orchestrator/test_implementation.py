"""If these fail, a run goes on with other kernels than it began with, or is slow for a reason that nobody is told."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.fmus import build
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results import origin
from cardiac_cosim.orchestrator.results.origin import Origin
from cardiac_cosim.orchestrator.results.recording import Recording
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import Unit
from rich.console import Console

_SLOW = "no kernels are compiled: install a C compiler and set the project up again"
_SETS = ("run.stop_ms=3", "output.every_ms=1", "run.checkpoint_every=1")


def _run(scenario: Path, out: Path, *sets: str, resume: bool = False, console: Console | None = None) -> dict[str, Any]:
    loaded = load_scenario(scenario, (*_SETS, *sets))
    return run_scenario(loaded, scenario.parent, out, console, scenario.parent, resume).summary


@pytest.fixture
def other_kernels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Units, called directly and in FMUs, that compute with something else, and are slow."""

    def fallbacks(self: Unit) -> Iterator[str]:
        yield _SLOW

    for unit in (Unit, *UNITS.values()):
        if "implementation" in vars(unit):
            monkeypatch.setattr(unit, "implementation", lambda self: "slide rules, µ")
            monkeypatch.setattr(unit, "fallbacks", fallbacks)
    # The same in the code that FMUs carry, behind what it says itself.
    carried = build.sources()
    code = carried["units/registry.py"].decode() + (
        f"""

def _fallbacks(self):
    yield {_SLOW!r}


for _unit in (Unit, *UNITS.values()):
    _unit.implementation = lambda self: "slide rules, µ"
    _unit.fallbacks = _fallbacks
"""
    )
    monkeypatch.setattr(build, "sources", lambda: carried | {"units/registry.py": code.encode()})


@pytest.mark.parametrize("way", ["native", "fmu", "fmu3", "workers"])
def test_what_units_compute_with_is_in_the_summary_and_a_fallback_is_told_once(
    way: str, small_scenario: Path, tmp_path: Path, other_kernels: None, capsys: pytest.CaptureFixture[str]
) -> None:
    sets = ["run.participants=fmu", "run.workers=processes"] if way == "workers" else [f"run.participants={way}"]
    summary = _run(small_scenario, tmp_path / "out", *sets, console=Console(stderr=True))
    names = load_scenario(small_scenario).units
    assert summary["implementation"] == dict.fromkeys(names, "slide rules, µ")
    assert summary["warnings"].count(_SLOW) == 1
    assert capsys.readouterr().err.count(_SLOW) == 1
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["implementation"] == summary["implementation"]


def test_it_can_be_recorded_like_any_variable(small_scenario: Path, tmp_path: Path) -> None:
    rows = []
    for way in ("native", "fmu", "fmu3"):
        _run(small_scenario, tmp_path / way, f"run.participants={way}", "output.variables=[mechanics.implementation]")
        rows.append((tmp_path / way / "timeseries.csv").read_text())
    assert rows[0].splitlines()[0] == "time_ms,implementation"
    assert " factors (" in rows[0].splitlines()[1]
    assert rows == [rows[0]] * 3


@pytest.mark.parametrize("way", ["native", "fmu"])
def test_a_run_does_not_go_on_with_other_kernels_than_it_began_with(
    way: str, small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    out, sets = tmp_path / "out", (f"run.participants={way}",)

    class Stops(Recording):
        def accept(self, step: Any, exchange: Any) -> None:
            super().accept(step, exchange)
            if step.number == 2:
                raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("cardiac_cosim.orchestrator.results.folder.Recording", Stops)
        with pytest.raises(KeyboardInterrupt):
            _run(small_scenario, out, *sets)
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    request.getfixturevalue("other_kernels")
    with pytest.raises(InputError, match=r"computed with NumPy and computes with slide rules, µ here.*last digits"):
        _run(small_scenario, out, *sets, resume=True)
    assert {path: path.read_bytes() for path in out.rglob("*") if path.is_file()} == before
    monkeypatch.undo()
    assert _run(small_scenario, out, *sets, resume=True)["status"] == "done"


def test_a_run_whose_units_have_no_initial_state_says_of_none_what_it_computes_with(
    small_scenario: Path, tmp_path: Path
) -> None:
    with pytest.raises(Exception, match="stress-free"):
        _run(small_scenario, tmp_path / "out", "units.mechanics.parameters.neo_hooke_log_sign=as_printed")
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["implementation"] == {}


def test_before_it_is_initialised_a_unit_does_not_say_what_it_computes_with(small_heart: Any) -> None:
    unit = Mechanics(small_heart)
    assert unit.get("implementation") == unit.get("fallbacks") == ""
    unit.setup_experiment()
    unit.enter_initialization_mode()
    assert unit.get("implementation") == ""


def test_packages_that_may_be_missing_are_of_the_origin_where_they_are_installed(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load_scenario(small_scenario)
    without = Origin.of(scenario, tmp_path)
    monkeypatch.setattr(origin, "_version", lambda name: "1.7.0")
    having = Origin.of(scenario, tmp_path)
    assert having.versions["rslab"] == having.versions["pyamg"] == "1.7.0"
    assert "numpy was" in " ".join(having.changes(without))
