"""If these failed, other tools could couple cells and strands of ours, but not a heart with its fields of thousands."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

# Minutes: the tools take the fields apart into scalars.
pytestmark = pytest.mark.long

_STEPS = 21
_OSP = f"""
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimObserver import CosimObserver
log_output_level(CosimLogLevel.WARNING)
execution = CosimExecution.from_osp_config_file("heart/OspSystemStructure.xml")
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
unit = execution.slave_index_from_instance_name("mechanics")
volume = [v.reference for v in execution.slave_variables(unit) if v.name == b"lv_volume"]
assert execution.step({_STEPS})
print(observer.last_real_values(unit, volume)[0])
"""
_CONTAINER = f"""
from fmpy import simulate_fmu
course = simulate_fmu("heart/baseline_container.fmu", stop_time={_STEPS / 1000}, output_interval=0.001, validate=False)
print(course["mechanics.lv_volume"][-1])
"""


@pytest.fixture(scope="module")
def volume(workshop: Any) -> float:
    """The left ventricle's after a Jacobi run of our own; its FMUs are in the workshop then."""
    # As other masters do it: all at the same time, with inputs that are held.
    held = ["coupling.scheme=jacobi", "coupling.interpolation=hold", "coupling.extrapolation=0"]
    sets = [*held, f"run.stop_ms={_STEPS}", f"output.every_ms={_STEPS}"]
    options = [word for value in sets for word in ("--set", value)]
    cosim = str(Path(sys.executable).with_name("cosim"))
    native = ["--participants", "native", "--no-figures", "--no-report", "--output", "own"]
    workshop.run([cosim, "run", "scenarios/baseline.yaml", *native, *options])
    workshop.run([cosim, "build", "scenarios/baseline.yaml", "--output", "heart", "--osp", "--container"])
    series = np.genfromtxt(workshop.folder / "own" / "timeseries.csv", delimiter=",", names=True)
    assert series["lv_volume_ml"][-1] < series["lv_volume_ml"][0] - 0.2
    return float(series["lv_volume_ml"][-1])


def test_libcosim_couples_a_heart(workshop: Any, volume: float) -> None:
    assert float(workshop.run([sys.executable, "-c", _OSP])) == pytest.approx(volume, abs=1e-12)


def test_a_container_holds_a_heart(workshop: Any, volume: float) -> None:
    fmucontainer = str(Path(sys.executable).with_name("fmucontainer"))
    workshop.run([fmucontainer, "-fmu-directory", "heart", "-container", "baseline.json"])
    assert float(workshop.run([sys.executable, "-c", _CONTAINER]).splitlines()[-1]) == pytest.approx(volume, abs=1e-12)
