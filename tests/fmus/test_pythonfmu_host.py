"""If this failed, a host with another pythonfmu than the FMU's would run it, and nobody knew why it then failed."""

from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
from cardiac_cosim.fmus import wrapper
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

_STEP = """
import sys, pythonfmu
pythonfmu.__version__ = sys.argv[2]
driver = Driver(sys.argv[1])
driver.start({}, {})
print(driver.step(0.0, 1e-3), driver.refused)
for status, category, text in driver.messages:
    print(status, category, text)
driver.close()
"""


@pytest.fixture
def fmu(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An FMU with pythonfmu's binary, as it is built where there is no compiler."""
    monkeypatch.setattr(wrapper, "library", lambda: None)
    return build_fmu(UNITS["fiber_generator"], tiny, tmp_path / "fiber_generator.fmu")


def test_a_host_with_another_pythonfmu_is_told_so(fmu: Path, outside: Callable[..., str]) -> None:
    first, warning = outside(_STEP, fmu, "0.6.3").splitlines()
    assert first == "0 []"
    assert warning.startswith(
        f"1 logStatusWarning this FMU is made for pythonfmu {version('pythonfmu')}, "
        "and its host has loaded pythonfmu 0.6.3 from "
    )


def test_a_host_with_the_same_pythonfmu_is_told_nothing(fmu: Path, outside: Callable[..., str]) -> None:
    assert outside(_STEP, fmu, version("pythonfmu")) == "0 []\n"
