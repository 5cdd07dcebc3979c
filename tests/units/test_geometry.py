"""If these fail, the heart has the wrong shape: wrong volumes, elements that break the solvers, or leaking cavities."""

import hashlib
import math
import platform
import subprocess
import sys
import threading
from collections import Counter
from pathlib import Path

import gmsh
import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.geometry.biventricle import Biventricle
from cardiac_cosim.units.geometry.ellipsoid import crescent_volume, half_ellipsoid_volume, level
from cardiac_cosim.units.geometry.gmsh_session import DEBIAN_PACKAGES, gmsh_model
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.quality import signed_inverse_condition_number

# What made the shipped mesh; another gmsh, or the same one compiled for other hardware, may make another mesh.
_MADE_BY = ("4.15.2", "Linux", "x86_64")

_HEART = Biventricle()
_RV_CAVITY = ("rv_endocardium", "rv_septum")

_meshes: dict[float, Mesh] = {}


def _mesh(size_mm: float) -> Mesh:
    if size_mm not in _meshes:
        _meshes[size_mm] = _HEART.mesh(size_mm)
    return _meshes[size_mm]


def _under(mesh: Mesh, *names: str) -> float:
    """∫ x n_x over boundaries that are open in the plane Z = 0 only: the volume they enclose, < 0 for a cavity."""
    corners = mesh.points[np.concatenate([mesh.boundary(name) for name in names])]
    areas = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(corners[:, :, 0].mean(axis=1) @ areas[:, 0])


def _volume_errors(mesh: Mesh) -> dict[str, float]:
    """Relative errors of the volumes that follow from the mesh alone."""
    walls = _HEART.lv_wall_volume + _HEART.rv_wall_volume
    cavities = _HEART.lv_cavity_volume + _HEART.rv_cavity_volume
    return {
        "tissue": float(mesh.volumes.sum()) / walls - 1.0,
        "LV cavity": -_under(mesh, "lv_endocardium") / _HEART.lv_cavity_volume - 1.0,
        "RV cavity": -_under(mesh, *_RV_CAVITY) / _HEART.rv_cavity_volume - 1.0,
        "heart": _under(mesh, "epicardium") / (walls + cavities) - 1.0,
    }


def _rim(faces: np.ndarray) -> np.ndarray:
    """Nodes of the edges that belong to one face only; no edge may belong to more than two."""
    edges = Counter(tuple(sorted(edge)) for face in faces.tolist() for edge in (face[:2], face[1:], face[::2]))
    assert set(edges.values()) <= {1, 2}
    return np.unique([edge for edge, count in edges.items() if count == 1])


def _digest(mesh: Mesh) -> str:
    arrays = (mesh.points, mesh.cells, *mesh.boundaries.values())
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


# --- exact volumes -------------------------------------------------------------------------------------------------


def test_volumes_of_the_anatomy() -> None:
    # Source: specification of the anatomy, in ml to the digits printed there.
    volumes = (_HEART.lv_wall_volume, _HEART.lv_cavity_volume, _HEART.rv_wall_volume, _HEART.rv_cavity_volume)
    np.testing.assert_allclose(volumes, [92589.0, 39358.0, 21609.0, 13452.0], atol=0.5)


def test_crescent_against_the_lune() -> None:
    # Equal y semi-axes: the surfaces cross in a plane, each volume is a lune of a stretched ball, 2/3 abc φ.
    axes, core = _HEART.rv_outer, _HEART.lv_outer
    slope = math.sqrt((1 / axes[2] ** 2 - 1 / core[2] ** 2) / (1 / core[0] ** 2 - 1 / axes[0] ** 2))
    lunes = [2 / 3 * math.prod(abc) * math.atan2(abc[0], slope * abc[2]) for abc in (axes, core)]
    assert crescent_volume(axes, core) == pytest.approx(lunes[0] - lunes[1], rel=1e-12)


def test_crescent_against_counting() -> None:
    axes, core = _HEART.rv_inner, _HEART.lv_outer
    points = np.random.default_rng(0).random((1_000_000, 3)) * axes
    inside = (level(axes, points) < 0.0) & (level(core, points) > 0.0)
    # y > 0 only was sampled: half of it.
    assert crescent_volume(axes, core) == pytest.approx(2.0 * inside.mean() * math.prod(axes), rel=0.01)


def test_crescent_refuses_ellipsoids_that_do_not_cross_so() -> None:
    with pytest.raises(ValueError, match="longer than"):
        crescent_volume(_HEART.lv_outer, _HEART.rv_inner)


# --- solid and mesh ------------------------------------------------------------------------------------------------


def test_solid_has_the_exact_volume() -> None:
    with gmsh_model(5.0) as session:
        mass = session.model.occ.getMass(3, _HEART.solid(session))
    assert mass == pytest.approx(_HEART.lv_wall_volume + _HEART.rv_wall_volume, rel=5e-4)


@pytest.mark.parametrize(
    "size_mm",
    [12.0, 8.0, 6.0, 5.0, 4.0, pytest.param(3.0, marks=pytest.mark.long), pytest.param(2.0, marks=pytest.mark.long)],
)
def test_elements_are_well_shaped(size_mm: float) -> None:
    mesh = _mesh(size_mm)
    assert signed_inverse_condition_number(mesh).min() > 0.2
    edges = np.linalg.norm(mesh.points[mesh.cells[:, 1:]] - mesh.points[mesh.cells[:, :1]], axis=2)
    assert 0.7 * size_mm < edges.mean() < 1.3 * size_mm


def test_every_surface_face_is_on_one_boundary() -> None:
    mesh = _mesh(8.0)
    assert set(mesh.boundaries) == {"base", "epicardium", "lv_endocardium", "rv_endocardium", "rv_septum"}
    named = np.sort(np.concatenate(list(mesh.boundaries.values())), axis=1)
    np.testing.assert_array_equal(np.unique(named, axis=0), np.unique(np.sort(mesh.surface, axis=1), axis=0))
    assert len(named) == len(mesh.surface)


@pytest.mark.parametrize("size_mm", [8.0, 5.0])
def test_boundary_nodes_lie_on_their_ellipsoids(size_mm: float) -> None:
    mesh = _mesh(size_mm)
    surfaces = {
        "lv_endocardium": _HEART.lv_inner,
        "rv_endocardium": _HEART.rv_inner,
        "rv_septum": _HEART.lv_outer,
    }
    for name, axes in surfaces.items():
        assert np.abs(level(axes, mesh.points[mesh.boundary_nodes(name)])).max() < 1e-7
    outside = mesh.points[mesh.boundary_nodes("epicardium")]
    off_lv, off_rv = (np.abs(level(axes, outside)) for axes in (_HEART.lv_outer, _HEART.rv_outer))
    assert np.where(outside[:, 0] > 0.0, np.minimum(off_lv, off_rv), off_lv).max() < 1e-7
    # The septum is where the RV cavity is: X > 0 and inside the RV's inner ellipsoid.
    septum = mesh.points[mesh.boundary_nodes("rv_septum")]
    assert septum[:, 0].min() > 0.0
    assert level(_HEART.rv_inner, septum).max() < 1e-7


@pytest.mark.parametrize("size_mm", [8.0, 5.0])
@pytest.mark.parametrize("names", [("lv_endocardium",), _RV_CAVITY, ("epicardium",)])
def test_cavities_open_in_the_base_plane_only(size_mm: float, names: tuple[str, ...]) -> None:
    mesh = _mesh(size_mm)
    rim = _rim(np.concatenate([mesh.boundary(name) for name in names]))
    assert (mesh.points[rim, 2] == 0.0).all()
    assert set(rim) <= set(mesh.boundary_nodes("base"))
    assert (mesh.points[mesh.boundary_nodes("base"), 2] == 0.0).all()


def test_volumes_of_the_baseline_mesh() -> None:
    errors = _volume_errors(_mesh(5.0))
    assert max(map(abs, errors.values())) < 0.02, errors


def test_walls_of_the_baseline_mesh() -> None:
    # Each element's share outside the LV's outer ellipsoid, on a lattice of points, is right ventricular wall.
    mesh = _mesh(5.0)
    steps = 8
    lattice = np.array([(i, j, k) for i in range(steps) for j in range(steps - i) for k in range(steps - i - j)])
    weights = np.column_stack([lattice, steps - 1 - lattice.sum(axis=1)]) + 0.25
    points = np.einsum("pv,evx->epx", weights / steps, mesh.points[mesh.cells])
    share = (level(_HEART.lv_outer, points.reshape(-1, 3)) > 0.0).reshape(points.shape[:2]).mean(axis=1)
    assert mesh.volumes @ share == pytest.approx(_HEART.rv_wall_volume, rel=0.02)
    assert mesh.volumes @ (1.0 - share) == pytest.approx(_HEART.lv_wall_volume, rel=0.02)


@pytest.mark.parametrize("sizes", [(8.0, 6.0, 5.0, 4.0), pytest.param((5.0, 3.0, 2.0), marks=pytest.mark.long)])
def test_volumes_converge_at_second_order(sizes: tuple[float, ...]) -> None:
    errors = [_volume_errors(_mesh(size)) for size in sizes]
    for name in errors[0]:
        order = np.polyfit(np.log(sizes), np.log([abs(error[name]) for error in errors]), 1)[0]
        assert 1.7 < order < 2.4, name


# --- gmsh as a guest -----------------------------------------------------------------------------------------------


def test_same_call_same_mesh_in_any_process() -> None:
    again = _HEART.mesh(8.0)
    assert _digest(again) == _digest(_mesh(8.0))
    code = (
        "from cardiac_cosim.units.geometry.biventricle import Biventricle as B; "
        "import sys, numpy; m = B().mesh(8.0); "
        "sys.stdout.buffer.write(b''.join(a.tobytes() for a in (m.points, m.cells, *m.boundaries.values())))"
    )
    fresh = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    # The bytes of the mesh are also all that reached the terminal.
    assert hashlib.sha256(fresh.stdout).hexdigest() == _digest(again)
    assert not fresh.stderr


def test_meshes_outside_the_main_thread() -> None:
    made: list[Mesh] = []
    thread = threading.Thread(target=lambda: made.append(_HEART.mesh(8.0)))
    thread.start()
    thread.join()
    assert _digest(made[0]) == _digest(_mesh(8.0))


def test_callers_gmsh_session_is_left_alone() -> None:
    expected = _digest(_mesh(8.0))
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.Algorithm", 5)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
        gmsh.model.add("theirs")
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        gmsh.model.occ.synchronize()
        gmsh.model.add("another")
        gmsh.model.setCurrent("theirs")
        models = gmsh.model.list()
        assert _digest(_HEART.mesh(8.0)) == expected
        assert gmsh.isInitialized()
        assert gmsh.model.list() == models
        assert gmsh.model.getCurrent() == "theirs"
        assert gmsh.model.getEntities(3) == [(3, 1)]
        assert gmsh.option.getNumber("Mesh.Algorithm") == 5
        assert gmsh.option.getNumber("Mesh.MeshSizeMax") == 0.5
    finally:
        gmsh.finalize()


def test_gmsh_is_finalised_after_a_failure() -> None:
    with pytest.raises(KeyError), gmsh_model(5.0):
        raise KeyError
    assert not gmsh.isInitialized()


def _break_gmsh(error: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gmsh.py").write_text(f"raise {error}\n")
    monkeypatch.delitem(sys.modules, "gmsh")
    monkeypatch.syspath_prepend(tmp_path)


def test_missing_libraries_name_the_packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _break_gmsh("OSError('libGLU.so.1: cannot open shared object file')", tmp_path, monkeypatch)
    with pytest.raises(InvalidInput, match=r"libGLU\.so\.1.*apt-get install " + " ".join(DEBIAN_PACKAGES)):
        _HEART.mesh(8.0)


def test_missing_gmsh_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _break_gmsh("ImportError('no such module')", tmp_path, monkeypatch)
    with pytest.raises(InvalidInput, match="pip install gmsh"):
        _HEART.mesh(8.0)


# --- wrong input ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size_mm", [0.0, -5.0, math.nan, math.inf, 0.005, 12.1, 50.0])
def test_senseless_sizes_are_refused(size_mm: float) -> None:
    with pytest.raises(InvalidInput, match="mesh_size_mm"):
        registry.build("biventricle", size_mm)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"lv_wall": -1.0}, "positive"),
        ({"rv_wall": math.nan}, "positive"),
        ({"lv_wall": 30.0}, "no cavity"),
        ({"rv_outer": (51.0, 28.0, 60.0)}, "y semi-axis"),
        ({"rv_outer": (51.0, 30.0, 70.0)}, "z semi-axis"),
        ({"rv_outer": (35.0, 30.0, 60.0)}, "x semi-axis"),
    ],
)
def test_impossible_anatomies_are_refused(wrong: dict, message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        Biventricle(**wrong)


def test_another_heart_can_be_meshed() -> None:
    heart = Biventricle(lv_outer=(26.0, 26.0, 60.0), lv_wall=9.0, rv_outer=(46.0, 26.0, 52.0), rv_wall=4.0)
    mesh = heart.mesh(7.0)
    assert signed_inverse_condition_number(mesh).min() > 0.05
    assert -_under(mesh, *_RV_CAVITY) == pytest.approx(heart.rv_cavity_volume, rel=0.05)
    assert -_under(mesh, "lv_endocardium") == pytest.approx(half_ellipsoid_volume(heart.lv_inner), rel=0.05)


# --- registry and shipped mesh -------------------------------------------------------------------------------------


def test_unknown_geometry_suggests_a_known_one() -> None:
    with pytest.raises(InvalidInput, match=r"known: biventricle.*did you mean 'biventricle'"):
        registry.build("biventrical", 5.0)


def test_registry_generates_other_sizes() -> None:
    assert _digest(registry.build("biventricle", 8.0)) == _digest(_mesh(8.0))


def test_baseline_needs_no_gmsh(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _break_gmsh("OSError('libGLU.so.1')", tmp_path, monkeypatch)
    assert registry.build("biventricle", 5).elements > 5000


def test_shipped_baseline_is_what_the_recipe_makes() -> None:
    shipped, made = registry.build("biventricle", 5.0), _mesh(5.0)
    assert max(map(abs, _volume_errors(shipped).values())) < 0.02
    assert signed_inverse_condition_number(shipped).min() > 0.2
    if (gmsh.__version__, platform.system(), platform.machine()) == _MADE_BY:
        np.testing.assert_allclose(shipped.points, made.points, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(shipped.cells, made.cells)
        assert list(shipped.boundaries) == list(made.boundaries)
        for name, faces in shipped.boundaries.items():
            np.testing.assert_array_equal(faces, made.boundary(name))
    else:
        assert shipped.nodes == pytest.approx(made.nodes, rel=0.05)
        assert shipped.elements == pytest.approx(made.elements, rel=0.05)
        assert shipped.volumes.sum() == pytest.approx(made.volumes.sum(), rel=0.005)


@pytest.mark.skipif(sys.platform != "linux", reason="reads what Linux tells of a process")
def test_after_a_mesh_a_broken_pipe_is_an_error_and_not_the_end_of_the_process() -> None:
    # gmsh has it end the process: a run of a scene that is meshed would end without a word when a reader of its output
    # is gone.
    code = """
import os, threading
from cardiac_cosim.units.geometry.gmsh_session import gmsh_model
def session():
    with gmsh_model(5.0):
        pass
session()
other = threading.Thread(target=session)
other.start()
other.join()
reader, writer = os.pipe()
os.close(reader)
try:
    os.write(writer, b"to nobody")
except BrokenPipeError:
    print("an error")
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (0, "an error\n"), ended.stderr
