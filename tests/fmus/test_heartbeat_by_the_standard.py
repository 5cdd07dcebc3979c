"""If this failed, our FMUs would need our own master: who couples them by the standard alone got another heartbeat."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario

_MASTER = (Path(__file__).parent / "fmi_master.py").read_text()
_BASELINE = Path(__file__).parents[2] / "scenarios" / "baseline.yaml"

#: The script holds inputs over a step, and so do we then.
_HELD = ("run.participants=native", "coupling.interpolation=hold", "coupling.extrapolation=0")


def _built(scenario: Path, folder: Path, fmi: int) -> list[Path]:
    """The FMUs that the command builds, in the scenario's order."""
    command = [sys.executable, "-m", "cardiac_cosim.cli", "build", str(scenario), "--output", str(folder)]
    command += ["--fmi", str(fmi)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return [Path(line) for line in done.stdout.splitlines()]


def _parameters(scenario: Scenario) -> dict[str, Any]:
    return {str(entry.unit): dict(entry.parameters) for entry in scenario.units.values()}


def _beat(
    path: Path, step_ms: float, stop_ms: float, fmi: int, outside: Callable[..., str], folder: Path
) -> np.ndarray:
    """Our own time series of the heart in a scenario file, once the script has got the same from its FMUs."""
    sets = [f"coupling.step_ms={step_ms}", f"run.stop_ms={stop_ms}", f"output.every_ms={stop_ms}", *_HELD]
    scenario = load_scenario(path, sets)
    run_scenario(scenario, path.parent, folder / "own")
    own = np.genfromtxt(folder / "own" / "timeseries.csv", delimiter=",", names=True)

    parameters = folder / "parameters.json"
    parameters.write_text(json.dumps(_parameters(scenario)))
    fmus = _built(path, folder / "fmus", fmi)
    assert [path.stem for path in fmus] == ["fiber_generator", "electrophysiology", "active_stress", "mechanics"]
    steps = round(stop_ms / step_ms)
    outside(_MASTER, step_ms / 1000.0, steps, parameters, folder / "theirs.npz", *fmus)

    with np.load(folder / "theirs.npz") as theirs:
        for column in ("lv_volume_ml", "rv_volume_ml", "apex_uplift_mm", "active_stress_mean_kPa"):
            assert np.array_equal(theirs[column.rpartition("_")[0]], own[column]), column
        with h5py.File(folder / "own" / "fields.h5") as fields:
            for name, column in (
                ("potential", "potential_mV"),
                ("active_stress", "active_stress_kPa"),
                ("stretch", "stretch"),
                ("displacement", "displacement_mm"),
            ):
                last = fields[f"frames/{column}"][-1]
                assert np.array_equal(theirs[name].reshape(last.shape), last), name
    assert len(own) == steps + 1
    return own


def test_a_script_that_knows_fmi_only_gets_our_heartbeat(
    fmi: int, small_scenario: Path, outside: Callable[..., str], tmp_path: Path
) -> None:
    volume = _beat(small_scenario, 5.0, 320.0, fmi, outside, tmp_path)["lv_volume_ml"]
    # It was a heartbeat: the ventricle emptied and filled again.
    assert volume.min() < 0.9 * volume[0]
    assert volume[-1] > volume.min() + 0.5


@pytest.mark.long
def test_and_the_begin_of_that_of_the_heart_that_is_shipped(
    fmi: int, outside: Callable[..., str], tmp_path: Path
) -> None:
    own = _beat(_BASELINE, 1.0, 15.0, fmi, outside, tmp_path)
    # It pulls already, and pumps.
    assert own["active_stress_mean_kPa"][-1] > 1.0
    assert own["lv_volume_ml"][-1] < own["lv_volume_ml"][0]
