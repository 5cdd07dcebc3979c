"""If this failed, a run would be given an FMU of the other version, or one of code that is gone."""

from pathlib import Path

import pytest
from cardiac_cosim.fmus import build
from cardiac_cosim.fmus.cache import cached_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS


def test_the_cache_keeps_both_versions_apart(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    unit = UNITS["active_stress"]
    two, three = cached_fmu(unit, tiny, tmp_path), cached_fmu(unit, tiny, tmp_path, fmi=3)
    assert two != three
    assert two.name == three.name == "active_stress.fmu"
    assert cached_fmu(unit, tiny, tmp_path, fmi=3) == three
    before = [build.fingerprint(unit, tiny, fmi) for fmi in (2, 3)]
    assert before[0] != before[1]
    monkeypatch.setattr(build, "version", lambda name: f"another {name}")
    assert not set(before) & {build.fingerprint(unit, tiny, fmi) for fmi in (2, 3)}
    with pytest.raises(ValueError, match="FMI 2 and 3, not for 1"):
        cached_fmu(unit, tiny, tmp_path, fmi=1)
