"""If these fail, an FMU is stale, half written, not reproducible, or building it disturbs the program that builds."""

import io
import random
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus import archive as archives
from cardiac_cosim.fmus import build, cache
from cardiac_cosim.units import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

_UNIT = UNITS["active_stress"]


def _changed(mesh: Mesh, points: np.ndarray | None = None, **boundaries: np.ndarray) -> Mesh:
    return Mesh(mesh.points if points is None else points, mesh.cells, {**mesh.boundaries, **boundaries})


def _other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """From here FMUs carry units whose active stress is twice as large."""
    files = build.sources()
    changed = files["units/active_stress.py"].replace(b"_KPA_PER_MPA = 1000.0", b"_KPA_PER_MPA = 2000.0")
    assert changed != files["units/active_stress.py"]
    monkeypatch.setattr(build, "sources", lambda: files | {"units/active_stress.py": changed})


# --- the archive ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", UNITS)
def test_the_same_content_makes_the_same_bytes(unit: str, fmi: int, tiny: Mesh, packed: dict, tmp_path: Path) -> None:
    again = build.build_fmu(UNITS[unit], tiny, tmp_path / "another name.fmu", fmi)
    assert again.read_bytes() == packed[unit].read_bytes()


def test_another_process_makes_the_same_bytes(fmus: dict, outside: Callable[..., str], tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus["mechanics"]) as archive:
        archive.extract("resources/mesh.npz", tmp_path)
    text = """
import sys
from pathlib import Path
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh.archive import unpack_mesh
from cardiac_cosim.units.registry import UNITS
build_fmu(UNITS["mechanics"], unpack_mesh(Path(sys.argv[1])), Path(sys.argv[2]))
"""
    outside(text, tmp_path / "resources" / "mesh.npz", tmp_path / "again.fmu", block=False)
    assert (tmp_path / "again.fmu").read_bytes() == fmus["mechanics"].read_bytes()


@pytest.mark.parametrize("unit", UNITS)
def test_the_baseline_hearts_fmus_are_small(unit: str, baseline_fmus: dict) -> None:
    assert baseline_fmus[unit].stat().st_size < 1_100_000


def test_any_unzipper_makes_readable_files(fmus: dict) -> None:
    with zipfile.ZipFile(fmus["mechanics"]) as archive:
        assert archive.testzip() is None
        members = archive.infolist()
    assert len(members) > 20
    assert {member.external_attr >> 16 for member in members} == {0o100644}
    assert {member.compress_type for member in members} == {zipfile.ZIP_DEFLATED}


def test_what_an_fmu_carries(tiny: Mesh, fmus: dict) -> None:
    with zipfile.ZipFile(fmus["mechanics"]) as archive:
        names = archive.namelist()
        packed = io.BytesIO(archive.read("resources/mesh.npz"))
    assert not [name for name in names if "orchestrator" in name or "geometry" in name or "__pycache__" in name]
    (package,) = {name.split("/")[1] for name in names if name.startswith("resources/cosim_")}
    units = Path(registry.__file__).parent
    modules = [path.relative_to(units) for path in units.rglob("*.py") if path.parent.name != "geometry"]
    assert len(modules) > 25
    assert {f"resources/{package}/units/{path.as_posix()}" for path in modules} < set(names)
    with np.load(packed) as stored:
        np.testing.assert_array_equal(stored["points"], tiny.points)
        np.testing.assert_array_equal(stored["cells"], tiny.cells)
        for name, faces in tiny.boundaries.items():
            np.testing.assert_array_equal(stored[f"boundary/{name}"], faces)


# --- the cache -----------------------------------------------------------------------------------------------------


def test_the_same_content_is_built_once(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = cache.cached_fmu(_UNIT, tiny, tmp_path)
    assert first.is_relative_to(tmp_path)
    assert first.name == "active_stress.fmu"
    monkeypatch.setattr(cache, "build_fmu", lambda *_: pytest.fail("built again"))
    copied = Mesh(tiny.points.copy(), tiny.cells.copy(), dict(reversed(tiny.boundaries.items())))
    assert cache.cached_fmu(_UNIT, copied, tmp_path) == first


def test_without_a_folder_it_is_the_users_cache(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "user_cache_path", lambda name: tmp_path / name)
    path = cache.cached_fmu(_UNIT, tiny)
    assert path.is_relative_to(tmp_path / "cardiac-cosim")
    assert path.is_file()


def test_a_damaged_fmu_in_the_cache_is_built_anew(tiny: Mesh, tmp_path: Path) -> None:
    path = cache.cached_fmu(_UNIT, tiny, tmp_path)
    good = path.read_bytes()
    chance = random.Random(4)
    damaged = [good[:size] for size in (0, 1000, len(good) // 2, len(good) - 1)]
    with zipfile.ZipFile(path) as archive:
        members = [(member.header_offset + 100, member.compress_size - 100) for member in archive.infolist()]
    for begin, size in chance.choices([(begin, size) for begin, size in members if size > 0], k=8):
        place = begin + chance.randrange(size)
        damaged.append(good[:place] + bytes([good[place] ^ 4]) + good[place + 1 :])
    # A whole FMU, but of another unit.
    other = next(unit for unit in UNITS.values() if unit is not _UNIT)
    damaged.append(build.build_fmu(other, tiny, tmp_path / "other.fmu").read_bytes())
    for content in damaged:
        path.write_bytes(content)
        assert cache.cached_fmu(_UNIT, tiny, tmp_path) == path
        assert path.read_bytes() == good
        # Once it was found to be whole, a hash says so; that of an earlier file says nothing of this one.
        assert cache.cached_fmu(_UNIT, tiny, tmp_path) == path
    assert {member.name for member in path.parent.iterdir()} == {path.name, "active_stress.sha256"}


def test_without_a_home_nothing_is_built_where_the_person_is(
    tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cache, "user_cache_path", lambda name: Path("~/.cache") / name)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OSError, match="no home folder"):
        cache.cached_fmu(_UNIT, tiny)
    assert list(tmp_path.iterdir()) == []


def test_any_other_content_is_another_file(tiny: Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    moved = tiny.points.copy()
    moved[3, 1] = np.nextafter(moved[3, 1], 99.0)
    prints = {
        build.fingerprint(_UNIT, tiny),
        build.fingerprint(UNITS["mechanics"], tiny),
        build.fingerprint(_UNIT, _changed(tiny, points=moved)),
        build.fingerprint(_UNIT, _changed(tiny, lid=tiny.boundary("base"))),
        build.fingerprint(_UNIT, _changed(tiny, base=tiny.boundary("base")[1:])),
        build.fingerprint(
            _UNIT,
            _changed(tiny, lv_endocardium=tiny.boundary("epicardium"), epicardium=tiny.boundary("lv_endocardium")),
        ),
    }
    _other_code(monkeypatch)
    prints.add(build.fingerprint(_UNIT, tiny))
    monkeypatch.setattr(build, "version", lambda name: f"another {name}")
    prints.add(build.fingerprint(_UNIT, tiny))
    assert len(prints) == 8


# --- several builders, several versions ------------------------------------------------------------------------------


def test_a_build_inside_a_build(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another process finishes the same file while this one writes it."""
    destination = tmp_path / "same.fmu"

    def interrupted(members: zipfile.ZipFile, name: str, content: bytes) -> None:
        monkeypatch.setattr(archives, "add", add)
        add(members, name, content)
        build.build_fmu(_UNIT, tiny, destination)

    add = archives.add
    monkeypatch.setattr(archives, "add", interrupted)
    build.build_fmu(_UNIT, tiny, destination)
    with zipfile.ZipFile(destination) as archive:
        assert archive.testzip() is None
    assert [path.name for path in tmp_path.iterdir()] == ["same.fmu"]


def test_two_processes_build_the_same_fmu(fmus: dict, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus["active_stress"]) as archive:
        archive.extract("resources/mesh.npz", tmp_path / "mesh")
    text = """
import sys
from pathlib import Path
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh.archive import unpack_mesh
from cardiac_cosim.units.registry import UNITS
mesh = unpack_mesh(Path(sys.argv[1]))
for _ in range(6):
    build_fmu(UNITS["active_stress"], mesh, Path(sys.argv[2]))
"""
    destination = tmp_path / "cache" / "active_stress.fmu"
    command = [
        sys.executable,
        "-c",
        text,
        str(tmp_path / "mesh" / "resources" / "mesh.npz"),
        str(destination),
    ]
    builders = [subprocess.Popen(command, stderr=subprocess.PIPE, text=True) for _ in range(2)]
    assert [(builder.communicate(timeout=120)[1], builder.returncode) for builder in builders] == [("", 0)] * 2
    assert destination.read_bytes() == fmus["active_stress"].read_bytes()
    assert [path.name for path in destination.parent.iterdir()] == ["active_stress.fmu"]


def test_a_build_that_fails_leaves_the_old_file(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    destination = tmp_path / "old.fmu"
    destination.write_text("old")

    def full(members: zipfile.ZipFile, name: str, content: bytes) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(archives, "add", full)
    with pytest.raises(OSError, match="no space"):
        build.build_fmu(_UNIT, tiny, destination)
    assert destination.read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["old.fmu"]


def test_two_versions_in_one_process_run_their_own_code(
    tiny: Mesh,
    fmus: dict,
    cases: dict,
    drive: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _other_code(monkeypatch)
    other = build.build_fmu(_UNIT, tiny, tmp_path / "active_stress.fmu")
    case = cases["active_stress"]
    drivers = [drive(fmus["active_stress"]), drive(other)]
    for driver in drivers:
        driver.start(case.parameters, case.first())
    for (time, size), inputs, expected in zip(case.steps, case.inputs, case.expected[1:], strict=True):
        for driver, factor in zip(drivers, (1.0, 2.0), strict=True):
            assert driver.step(time, size, inputs) == 0
            np.testing.assert_array_equal(driver.get("active_stress"), factor * expected["active_stress"])
    packages = []
    for path in (fmus["active_stress"], other):
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
        packages.extend({name.split("/")[1] for name in names if name.startswith("resources/cosim_")})
    assert len(set(packages)) == 2
    assert set(packages) <= set(sys.modules)
    assert drivers[0].description.guid != drivers[1].description.guid


# --- what building leaves behind -------------------------------------------------------------------------------------


def test_building_leaves_no_trace_in_the_process(fmus: dict, outside: Callable[..., str], tmp_path: Path) -> None:
    with zipfile.ZipFile(fmus["mechanics"]) as archive:
        archive.extract("resources/mesh.npz", tmp_path)
    text = """
import sys
from pathlib import Path
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh.archive import unpack_mesh
from cardiac_cosim.units.registry import UNITS
mesh = unpack_mesh(Path(sys.argv[1]))
path, modules = list(sys.path), set(sys.modules)
for name, unit in UNITS.items():
    build_fmu(unit, mesh, Path(sys.argv[2]) / f"{name}.fmu")
assert sys.path == path, sys.path
left = sorted(set(sys.modules) - modules)
assert not [name for name in left if name.startswith("cosim_") or name in UNITS], left
stray = [name for name, module in sys.modules.items() if "cosim-build-" in str(getattr(module, "__file__", ""))]
assert not stray, stray
print("clean")
"""
    printed = outside(text, tmp_path / "resources" / "mesh.npz", tmp_path, block=False)
    assert printed == "clean\n"


def test_building_leaves_running_fmus_alone(
    tiny: Mesh, fmus: dict, cases: dict, drive: Callable[..., Any], tmp_path: Path
) -> None:
    case = cases["mechanics"]
    driver = drive(fmus["mechanics"])
    driver.start(case.parameters, case.first())
    modules, path = set(sys.modules), list(sys.path)
    build.build_fmu(UNITS["mechanics"], tiny, tmp_path / "again.fmu")
    assert {name for name in modules if name.startswith(("cosim_", "mechanics_"))} <= set(sys.modules)
    assert sys.path == path
    for (time, size), inputs, expected in zip(case.steps, case.inputs, case.expected[1:], strict=True):
        assert driver.step(time, size, inputs) == 0
        np.testing.assert_array_equal(driver.get("displacement"), expected["displacement"].ravel())


def test_nothing_is_written_into_the_package(tiny: Mesh, tmp_path: Path) -> None:
    folders = [Path(build.__file__).parent, Path(registry.__file__).parent]

    def files() -> set[Path]:
        every = {path for folder in folders for path in folder.rglob("*")}
        return {path for path in every if "__pycache__" not in path.parts}

    before = files()
    build.build_fmu(_UNIT, tiny, tmp_path / "new" / "folder" / "x.fmu")
    assert files() == before
    assert [path.name for path in (tmp_path / "new" / "folder").iterdir()] == ["x.fmu"]


def test_kernels_that_were_compiled_are_carried_and_make_another_fmu(
    tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    floor = tmp_path / "units"
    shutil.copytree(Path(registry.__file__).parent, floor, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(build.registry, "__file__", str(floor / "registry.py"))

    # Each time as another process reads the code.
    monkeypatch.setattr(build, "sources", build.sources.__wrapped__)
    before = build.fingerprint(_UNIT, tiny)
    (floor / "mechanics" / "kernels.abi3.so").write_bytes(b"\x7fELF 1")
    one = build.fingerprint(_UNIT, tiny)
    with zipfile.ZipFile(build.build_fmu(_UNIT, tiny, tmp_path / "a.fmu")) as archive:
        (kernels,) = (name for name in archive.namelist() if name.endswith("kernels.abi3.so"))
        assert archive.read(kernels) == b"\x7fELF 1"
    (floor / "mechanics" / "kernels.abi3.so").write_bytes(b"\x7fELF 2")
    assert len({before, one, build.fingerprint(_UNIT, tiny)}) == 3
