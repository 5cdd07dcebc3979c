"""If these fail, what was kept of an FMU is taken for another, and a run is coupled by variables that are not there."""

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants import fmu_digest
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.fmu_digest import Digest, read_digest
from cardiac_cosim.orchestrator.participants.fmu_file import FmuFile
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.mesh import Mesh


@pytest.fixture
def many(tmp_path: Path, small_heart: Mesh, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An FMU of thousands of scalars, and an empty cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return build_fmu(ActiveStress, small_heart, tmp_path / "active_stress.fmu")


def _kept(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "cache").rglob("*.json"))


def _forbid_reading(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fmu_digest, "read_description", lambda file: pytest.fail("read again"))


def _shown(digest: Digest) -> list[object]:
    groups = [(*group[:4], list(group.references)) for group in (*digest.inputs, *digest.outputs)]
    return [digest.fmiVersion, digest.guid, digest.coSimulation, digest.fields, digest.memoryless, groups, digest.names]


def test_what_is_kept_says_what_the_description_says(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = read_digest(FmuFile(many))
    assert len(_kept(tmp_path)) == 1
    with monkeypatch.context() as patch:
        _forbid_reading(patch)
        again = read_digest(FmuFile(many), ["delay_function"])
        # Under another name, at another place, it is the same FMU.
        copied = shutil.copyfile(many, tmp_path / "b.fmu")
        assert _shown(read_digest(FmuFile(copied))) == _shown(again)
    assert _shown(again) == _shown(first)
    known = {variable.name: variable for variable in first.modelVariables}
    assert all(known[variable.name] == variable for variable in again.modelVariables)
    assert len(again.modelVariables) < 50 < len(first.modelVariables)


def test_elements_that_somebody_names_and_variables_to_observe_are_looked_for_in_all(
    many: Path, tmp_path: Path
) -> None:
    for _ in range(2):
        unit = FmuParticipant("a", many, {}, {"potential[3]": -70.0}, observe=["slow_*", "potential[2]"], loaded=False)
        assert sorted(unit.observed) == ["potential[2]", "slow_rate_per_ms"]
        with pytest.raises(InputError, match=r"no variable 'potential\[0\]' that takes a start value"):
            FmuParticipant("a", many, {}, {"potential[0]": -70.0}, loaded=False)
        with pytest.raises(InputError, match=r"no parameter 'slow_rate'.*slow_rate_per_ms"):
            FmuParticipant("a", many, {"slow_rate": 1.0}, loaded=False)


def test_another_fmu_of_the_same_name_is_another(many: Path, tmp_path: Path) -> None:
    read_digest(FmuFile(many))
    with zipfile.ZipFile(many) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    description = content["modelDescription.xml"]
    content["modelDescription.xml"] = description.replace(b'unit="kPa"', b'unit="Pa"')
    with zipfile.ZipFile(many, "w") as archive:
        for name, data in content.items():
            archive.writestr(name, data)
    (output,) = (group for group in read_digest(FmuFile(many)).outputs if group.name == "active_stress")
    assert output.first.unit == "Pa"


@pytest.mark.parametrize("damage", ["", "{}", "[1]", '{"inputs": [[1]]}', "no json", "half"])
def test_what_was_kept_and_is_damaged_is_read_anew(many: Path, tmp_path: Path, damage: str) -> None:
    first = read_digest(FmuFile(many))
    (path,) = _kept(tmp_path)
    good = path.read_text(encoding="utf-8")
    path.write_text(good[: len(good) // 2] if damage == "half" else damage, encoding="utf-8")
    assert _shown(read_digest(FmuFile(many))) == _shown(first)
    assert path.read_text(encoding="utf-8") == good


def test_without_a_place_to_keep_it_it_is_read_every_time(
    many: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert _shown(read_digest(FmuFile(many))) == _shown(read_digest(FmuFile(many)))


def test_a_small_description_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tiny = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2, 3]]))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    read_digest(FmuFile(build_fmu(ActiveStress, tiny, tmp_path / "a.fmu")))
    assert _kept(tmp_path) == []
