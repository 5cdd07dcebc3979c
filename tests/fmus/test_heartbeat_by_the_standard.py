"""If this failed, our FMUs would need our own master: who couples them by the standard alone got another heartbeat."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario

_MASTER = (Path(__file__).parent / "fmi_master.py").read_text()
_STEP_MS = 5.0
_STOP_MS = 320.0


def _built(scenario: Path, folder: Path, fmi: int) -> list[Path]:
    """The FMUs that the command builds, in the scenario's order."""
    command = [sys.executable, "-m", "cardiac_cosim.cli", "build", str(scenario), "--output", str(folder)]
    command += ["--fmi", str(fmi)]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    return [Path(line) for line in done.stdout.splitlines()]


def _parameters(scenario: Scenario) -> dict[str, Any]:
    return {str(entry.unit): dict(entry.parameters) for entry in scenario.units.values()}


def test_a_script_that_knows_fmi_only_gets_our_heartbeat(
    fmi: int, small_scenario: Path, outside: Callable[..., str], tmp_path: Path
) -> None:
    scenario = load_scenario(
        small_scenario, [f"coupling.step_ms={_STEP_MS}", f"run.stop_ms={_STOP_MS}", f"output.every_ms={_STOP_MS}"]
    )
    run_scenario(scenario, small_scenario.parent, tmp_path / "own")
    own = np.genfromtxt(tmp_path / "own" / "timeseries.csv", delimiter=",", names=True)

    parameters = tmp_path / "parameters.json"
    parameters.write_text(json.dumps(_parameters(scenario)))
    fmus = _built(small_scenario, tmp_path / "fmus", fmi)
    assert [path.stem for path in fmus] == ["fiber_generator", "electrophysiology", "active_stress", "mechanics"]
    steps = round(_STOP_MS / _STEP_MS)
    outside(_MASTER, _STEP_MS / 1000.0, steps, parameters, tmp_path / "theirs.npz", *fmus)

    with np.load(tmp_path / "theirs.npz") as theirs:
        for column in ("lv_volume_ml", "rv_volume_ml", "apex_uplift_mm", "active_stress_mean_kPa"):
            assert np.array_equal(theirs[column.rpartition("_")[0]], own[column]), column
        with h5py.File(tmp_path / "own" / "fields.h5") as fields:
            for name, column in (
                ("potential", "potential_mV"),
                ("active_stress", "active_stress_kPa"),
                ("stretch", "stretch"),
                ("displacement", "displacement_mm"),
            ):
                last = fields[f"frames/{column}"][-1]
                assert np.array_equal(theirs[name].reshape(last.shape), last), name
    # It was a heartbeat: the ventricle emptied and filled again.
    volume = own["lv_volume_ml"]
    assert len(volume) == steps + 1
    assert volume.min() < 0.9 * volume[0]
    assert volume[-1] > volume.min() + 0.5
