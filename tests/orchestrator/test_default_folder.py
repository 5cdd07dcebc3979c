"""If these fail, a second run replaces the results of yesterday without a word, or nobody finds what it left."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.results.checkpoint import Checkpoint
from cardiac_cosim.orchestrator.results.default_folder import default_folder
from cardiac_cosim.orchestrator.results.lock import FolderLock
from cardiac_cosim.orchestrator.results.origin import Origin
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario
from cardiac_cosim.orchestrator.simulation import simulate

Cosim = Callable[..., Any]


def _scenario(path: Path, *sets: str) -> Scenario:
    return load_scenario(path, list(sets))


def _left(folder: Path, scenario: Scenario, base: Path, status: str = "done") -> None:
    """What a run leaves, as far as it says of what it was."""
    folder.mkdir(parents=True, exist_ok=True)
    content = {"status": status, **Origin.of(scenario, base).content()}
    (folder / "summary.json").write_text(json.dumps(content))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "results"


@pytest.fixture
def taken(small_scenario: Path, root: Path) -> Path:
    """The folder of a run of the scenario as it is."""
    _left(root / "small", _scenario(small_scenario), small_scenario.parent)
    return root / "small"


_MECHANICS = "units.mechanics.parameters."
_NAMES: dict[str, tuple[list[str], str]] = {
    "a number": (["coupling.step_ms=0.5"], "small+step_ms=0.5"),
    "a choice": (["coupling.scheme=jacobi"], "small+scheme=jacobi"),
    "two keys": (["coupling.step_ms=0.5", "coupling.scheme=jacobi"], "small+scheme=jacobi+step_ms=0.5"),
    "a parameter": ([_MECHANICS + "shear_modulus_MPa=0.2"], "small+shear_modulus_MPa=0.2"),
    "one name in two units": (
        ["units.mechanics.every=2", "units.active_stress.every=2"],
        "small+active_stress.every=2+mechanics.every=2",
    ),
    "a section": (["coupling.iterate={converge: {stretch: {relative: 1e-4}}}"], "small+iterate"),
    "nothing": (["output.variables=null"], "small"),
    "yes or no": (["connect_by_name=false"], "small+connect_by_name=false"),
    "a path": (["scene.mesh=../../some where/mein Herz.msh"], "small+mesh=mein-Herz.msh"),
    "a path of a strange name": (["scene.mesh='/x/..'"], "small+2"),
    "a long value": ([f"scene.mesh={'x' * 60}.msh"], "small+2"),
    "four keys": (
        [f"{_MECHANICS}shear_modulus_MPa=0.2", "coupling.step_ms=0.5", "run.stop_ms=5", "coupling.scheme=jacobi"],
        "small+2",
    ),
    "a parameter less": (["units.electrophysiology.parameters={}"], "small+stimulus_depth_mm=default"),
    "an address": (["run.workers=tcp://10.0.0.1:8786"], "small+workers=10.0.0.1-8786"),
    "a probe with an umlaut": (["output.probes_mm.lücke=[0, 0, -60]"], "small+lücke"),
    "a key with dots in it": (["units.active_stress.parameters={a.b: 1}"], "small+2"),
}


@pytest.mark.parametrize(("sets", "name"), _NAMES.values(), ids=_NAMES)
def test_a_folder_is_called_by_how_the_settings_differ(
    small_scenario: Path, root: Path, taken: Path, sets: list[str], name: str
) -> None:
    scenario = _scenario(small_scenario, *sets)
    before = (taken / "summary.json").read_bytes()
    folder = default_folder(scenario, root=root)
    assert folder == root / name
    assert len(folder.name.encode()) <= 100
    # The same again takes its place, whatever came between.
    _left(folder, scenario, small_scenario.parent)
    assert default_folder(scenario, root=root) == folder
    assert default_folder(scenario, resume=True, root=root) == folder
    assert name == "small" or (taken / "summary.json").read_bytes() == before


def test_the_same_settings_are_found_wherever_they_lie(small_scenario: Path, root: Path, taken: Path) -> None:
    other = _scenario(small_scenario, "run.stop_ms=5")
    _left(root / "small+2", other, small_scenario.parent, status="failed")
    assert default_folder(other, root=root) == root / "small+2"
    # Somebody has removed the first one.
    (taken / "summary.json").unlink()
    assert default_folder(other, resume=True, root=root) == root / "small+2"
    assert default_folder(_scenario(small_scenario), root=root) == taken


def test_a_number_is_added_where_the_name_is_taken(small_scenario: Path, root: Path, taken: Path) -> None:
    half, other = (_scenario(small_scenario, *sets) for sets in (["run.stop_ms=5"], ["coupling.step_ms=0.5"]))
    # Called so by hand, or by a first folder that was another then.
    _left(root / "small+stop_ms=5", other, small_scenario.parent)
    assert default_folder(half, root=root) == root / "small+2"
    (root / "small+2").mkdir()
    (root / "small+2" / "summary.json").write_text("not ours")
    assert default_folder(half, root=root) == root / "small+3"


@pytest.mark.parametrize("status", ["done", "failed", "interrupted"])
def test_a_run_of_the_same_settings_is_replaced_however_it_ended(small_scenario: Path, root: Path, status: str) -> None:
    _left(root / "small", _scenario(small_scenario), small_scenario.parent, status)
    assert default_folder(_scenario(small_scenario), root=root) == root / "small"
    assert default_folder(_scenario(small_scenario, "run.stop_ms=5"), root=root) == root / "small+stop_ms=5"


def test_a_checkpoint_alone_tells_whose_it_is(small_scenario: Path, root: Path) -> None:
    # As kill -9 leaves it.
    scenario, other = _scenario(small_scenario), _scenario(small_scenario, "run.stop_ms=5")
    (root / "small").mkdir(parents=True)
    Checkpoint(root / "small", Origin.of(scenario, small_scenario.parent), {}).write()
    assert default_folder(scenario, resume=True, root=root) == root / "small"
    assert default_folder(other, root=root) == root / "small+stop_ms=5"
    # Resumed with other settings by mistake: the message names the keys, as nothing is begun anew beside it.
    assert default_folder(other, resume=True, root=root) == root / "small"
    damaged = root / "small" / "checkpoint.h5"
    damaged.write_bytes(damaged.read_bytes()[:100])
    assert default_folder(other, root=root) == root / "small+2"


@pytest.mark.parametrize("content", ["{}", "[]", "null", '{"scenario": 3}', "yesterday", ""])
def test_results_of_others_are_left_alone(small_scenario: Path, root: Path, content: str) -> None:
    (root / "small").mkdir(parents=True)
    (root / "small" / "summary.json").write_text(content)
    assert default_folder(_scenario(small_scenario), root=root) == root / "small+2"


def test_a_folder_without_results_is_nobodys(small_scenario: Path, root: Path) -> None:
    (root / "small").mkdir(parents=True)
    (root / "small" / "notes.txt").write_text("mine")
    # What a run that was killed before its first checkpoint leaves.
    (root / "small" / "timeseries.csv").write_text("time_ms\n")
    assert default_folder(_scenario(small_scenario), root=root) == root / "small"
    # But not while that run goes on.
    lock = FolderLock(root / "small")
    assert default_folder(_scenario(small_scenario), root=root) == root / "small+2"
    lock.release()
    (root / "file").write_text("")
    assert default_folder(_scenario(small_scenario, "name=file"), root=root) == root / "file+2"


def test_the_command_says_first_where_results_go_and_keeps_what_is_there(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    short = ("run", small_scenario, "--set", "run.stop_ms=5")
    assert cosim(*short).out.splitlines()[0] == "results go to results/small"
    first = (tmp_path / "results" / "small" / "timeseries.csv").read_bytes()
    other = (*short, "--set", "coupling.step_ms=2.5")
    ended = cosim(*other)
    assert (
        ended.out.splitlines()[0] == "results go to results/small+step_ms=2.5, because results/small has other results"
    )
    assert ended.out.splitlines()[-1] == "  results in results/small+step_ms=2.5"
    assert (tmp_path / "results" / "small" / "timeseries.csv").read_bytes() == first
    # Complete: nothing is run again.
    again = cosim(*other, "--resume")
    assert again.out.splitlines()[0] == ended.out.splitlines()[0]
    assert sorted(path.name for path in (tmp_path / "results").iterdir()) == ["small", "small+step_ms=2.5"]
    assert cosim(*short, "--quiet").out == ""
    # An --output is the person's choice.
    assert cosim(*other, "--output", "results/small").out.splitlines()[-1] == "  results in results/small"
    assert json.loads((tmp_path / "results" / "small" / "summary.json").read_text())["steps"] == 2
    run = simulate(small_scenario, {"run.stop_ms": 5, "coupling.step_ms": 1.25})
    assert run.folder == Path("results") / "small+step_ms=1.25"
