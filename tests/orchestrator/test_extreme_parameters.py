"""A slip in a parameter, a metre for a millimetre or a sign, could hang a run, or end in numbers that are none."""

import csv
import json
from collections.abc import Callable, Iterator
from math import isfinite
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality

Cosim = Callable[..., Any]

#: Small scenes: geometry, size in mm, and the units that step in them.
_SCENES = {
    "cell": ("cell", 5, ("electrophysiology", "active_stress", "local_mechanics")),
    "wave": ("cell", 5, ("eikonal", "active_stress", "local_mechanics")),
    "strand": ("strand", 20, ("electrophysiology", "active_stress", "local_mechanics")),
    "slab": ("slab", 10, ("electrophysiology", "active_stress", "mechanics")),
}

#: With these the wave starts and runs in all of them.
_ALWAYS = {"time_scale_reduction": 0, "stimulus_x_min_mm": -1}

Case = tuple[str, str, str, float]


def _cases(scene: str, units: tuple[str, ...], numbers: tuple[float, ...], counts: tuple[int, ...]) -> Iterator[Case]:
    """Each parameter that is a number, of some units of the scene, at each extreme."""
    for unit in units:
        for variable in UNITS[unit].variables():
            if variable.causality is Causality.PARAMETER and not isinstance(variable.start, str):
                for value in counts if isinstance(variable.start, int) else numbers:
                    yield scene, unit, variable.name, value


def _check(cosim: Cosim, folder: Path, case: Case) -> None:
    """The run ends with 0 and finite numbers, or with 2 or 3 and the name of what is wrong."""
    scene, changed, name, value = case
    geometry, size, units = _SCENES[scene]
    entries: dict[str, dict[str, Any]] = {"fibers": {"unit": "fiber_generator", "parameters": {}}}
    for unit in units:
        started = unit in ("electrophysiology", "eikonal")
        entries[unit] = {"unit": unit, "parameters": dict(_ALWAYS) if started else {}}
    entries["fibers" if changed == "fiber_generator" else changed]["parameters"][name] = value
    content = {
        "name": "extreme",
        "scene": {"geometry": geometry, "mesh_size_mm": size},
        "units": entries,
        "coupling": {"step_ms": 1},
        "run": {"stop_ms": 5, "participants": "native", "checkpoint_every": 0},
        "output": {"every_ms": 5},
    }
    path = folder / "extreme.yaml"
    path.write_text(json.dumps(content))
    ended = cosim("run", path, "--output", folder / "out")
    assert ended.code in (0, 2, 3), (case, ended)
    assert "Traceback" not in ended.err, (case, ended)
    if ended.code == 0:
        with (folder / "out" / "timeseries.csv").open() as file:
            rows = [float(cell) for row in list(csv.reader(file))[1:] for cell in row if cell]
        assert all(map(isfinite, rows)), (case, rows)
    else:
        assert name in ended.err, (case, ended)
        assert max(map(len, ended.err.splitlines())) < 1200, (case, ended)


@pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")
@pytest.mark.parametrize(
    ("scene", "unit"), [("cell", "active_stress"), ("cell", "electrophysiology"), ("wave", "eikonal")]
)
def test_extreme_parameters_of_a_cell_are_named(scene: str, unit: str, cosim: Cosim, tmp_path: Path) -> None:
    """A person could wait for ever, or search in vain for the parameter that is wrong."""
    for case in _cases(scene, (unit,), (1e308,), (10**9,)):
        # Of the wave, what differs: the pulse of a cell that it follows.
        if scene == "cell" or case[2].startswith(("excitation_", "recovery_")):
            _check(cosim, tmp_path, case)


@pytest.mark.long
@pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")
@pytest.mark.parametrize("scene", _SCENES)
def test_more_extreme_parameters_of_more_scenes_are_named(scene: str, cosim: Cosim, tmp_path: Path) -> None:
    """As above, in more places and by more values."""
    units = ("fiber_generator", *_SCENES[scene][2])
    for case in _cases(scene, units, (1e308, -1e308, 1e-308, 1e10, -1e5, 0.0), (0, 30, 1000, 10**9)):
        _check(cosim, tmp_path, case)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("coupling.step_ms=1e-7", "more than 1e+07 are refused"),
        ("run.stop_ms=1e300", "more than 1e+07 are refused"),
        ("coupling.adaptive={max_ms: 1e308}", "'coupling.adaptive.max_ms'"),
        ("coupling.adaptive={min_ms: 1e-300}", "more than 1e+07 are refused"),
        ("coupling.iterate={max_iterations: 100000000000, converge: {stretch: {relative: 1}}}", "max_iterations"),
        ("units.mechanics.every=100000000000", "'units.mechanics.every'"),
        ("units.electrophysiology.parameters.longest_substep_ms=1e-300", "longest_substep_ms"),
    ],
)
def test_extreme_numbers_of_a_scenario_are_named(
    assignment: str, words: str, small_scenario: Path, cosim: Cosim, tmp_path: Path
) -> None:
    """A run could begin that nobody lives to see the end of."""
    ended = cosim("run", small_scenario, "--output", tmp_path / "out", "--set", assignment)
    assert ended.code == 2, ended
    assert words in ended.err
    assert ended.err.count("\n") == 1


def test_a_step_of_too_many_substeps_is_refused(small_scenario: Path, cosim: Cosim, tmp_path: Path) -> None:
    """A long step of short substeps could take weeks, without a word."""
    sets = ["--set", "units.electrophysiology.parameters.longest_substep_ms=1e-4", "--set", "coupling.step_ms=100"]
    sets += ["--set", "run.stop_ms=100", "--set", "output.every_ms=100"]
    ended = cosim("run", small_scenario, "--output", tmp_path / "out", *sets)
    assert ended.code == 3, ended
    assert "1e+06 substeps of longest_substep_ms = 0.0001" in ended.err


def test_a_refinement_without_end_is_refused(small_scenario: Path, cosim: Cosim, tmp_path: Path) -> None:
    """A refinement of thirty levels could fill the memory before anything is said."""
    for levels in (5, 30, 10**9):
        refine = f"units.electrophysiology.parameters.refine={levels}"
        ended = cosim("run", small_scenario, "--output", tmp_path / "out", "--set", refine)
        assert ended.code == 2, ended
        assert f"parameter 'refine' is {levels}, which makes" in ended.err
