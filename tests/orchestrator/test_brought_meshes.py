"""If these fail, a person's own mesh gives wrong numbers with exit code 0, or is refused without a word why."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.file import write_mesh
from fallbacks import FALLBACKS

Cosim = Callable[..., Any]

#: The sound heart's tissue and cavities at rest, ml.
_LV, _RV = 36.2925, 12.8495

_WITHOUT_MECHANICS = (
    "units={f: {unit: fiber_generator}, e: {unit: electrophysiology, parameters: {stimulus_depth_mm: 5}}}"
)


def _file(path: Path, mesh: Mesh, points: np.ndarray | None = None, **boundaries: np.ndarray) -> Path:
    """`mesh` with other points and more boundaries, written as gmsh does; what is wrong with it is not looked at."""

    class Raw:
        elements = mesh.elements

    raw: Any = Raw()
    raw.points, raw.cells = mesh.points if points is None else points, mesh.cells
    raw.boundaries = {**mesh.boundaries, **boundaries}
    write_mesh(raw, path)
    return path


@pytest.fixture
def both(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> Callable[..., tuple[Any, Any]]:
    """How `cosim show` and `cosim run` of a mesh end, with mechanics or without, and what the run's summary says."""

    def call(path: Path, *sets: str) -> tuple[Any, Any, dict[str, Any]]:
        options = [text for assignment in (f"scene.mesh={path.name}", *sets) for text in ("--set", assignment)]
        shown = cosim("show", small_scenario, *options)
        ran = cosim("run", small_scenario, "--output", tmp_path / "out", *options)
        summary = tmp_path / "out" / "summary.json"
        return shown, ran, json.loads(summary.read_text()) if summary.exists() else {}

    return call


def _refused(both: Callable[..., Any], path: Path, *words: str, sets: tuple[str, ...] = ()) -> None:
    shown, ran, summary = both(path, *sets)
    assert summary == {}
    for ended in (shown, ran):
        assert ended.code == 2, ended
        assert ended.err.count("\n") == 1
        assert ended.err.startswith("error: ")
        for word in (path.name, *words):
            assert word in ended.err, ended.err


@pytest.mark.parametrize("sets", [(), (_WITHOUT_MECHANICS,)], ids=["heartbeat", "no mechanics"])
@pytest.mark.parametrize(
    ("turn", "by", "words"),
    [
        (np.diag([-1.0, 1.0, -1.0]), 0.0, ["[0, 0, 1]", "base is the highest plane", "apex lies below it"]),
        (np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]]), 0.0, ["the base faces in the direction [1.0, 0.0, 0.0]"]),
        (np.eye(3), 20.0, ["the base lies at Z = 20 mm", "move the mesh by -20 mm"]),
        (0.1 * np.eye(3), 0.0, ["7 mm high", "scene: {scale: cm}"]),
    ],
    ids=["apex up", "along x", "base at 20", "cm"],
)
def test_a_heart_in_another_frame_is_refused(
    turn: np.ndarray, by: float, words: list[str], sets: tuple[str, ...], both: Any, small_heart: Mesh, tmp_path: Path
) -> None:
    points = small_heart.points @ turn.T + [0.0, 0.0, by]
    _refused(both, _file(tmp_path / "o.msh", small_heart, points), *words, sets=sets)


def test_a_stated_unit_of_length_gives_the_hearts_volumes(both: Any, small_heart: Mesh, tmp_path: Path) -> None:
    path = _file(tmp_path / "cm.msh", small_heart, 0.1 * small_heart.points)
    for scale in ("cm", "10"):
        shown, ran, summary = both(path, f"scene.scale={scale}")
        assert (shown.code, ran.code) == (0, 0)
        assert "volume 112.46 ml" in shown.out
        assert summary["lv_volume_ml"]["start"] == pytest.approx(_LV, abs=1e-3)
        assert summary["warnings"] == list(FALLBACKS)
        assert summary["scenario"]["scene"]["scale"] == (scale if scale == "cm" else 10)


def test_wrong_surfaces_are_refused_without_mechanics_too(both: Any, small_heart: Mesh, tmp_path: Path) -> None:
    outer = small_heart.boundary("epicardium")
    right = small_heart.points[outer].mean(axis=1)[:, 0] > 0
    path = _file(tmp_path / "o.msh", small_heart, epicardium=outer[~right], rv_epicardium=outer[right])
    words = ["of 484 faces of the surface are in none of", "in 'rv_epicardium')"]
    _refused(both, path, *words)
    _refused(both, path, *words, sets=(_WITHOUT_MECHANICS,))
    shown, ran, summary = both(path, "scene.boundaries={epicardium: [epicardium, rv_epicardium]}")
    assert (shown.code, ran.code) == (0, 0)
    assert summary["rv_volume_ml"]["start"] == pytest.approx(_RV, abs=1e-3)


def test_a_mesh_for_arrival_times_needs_no_anatomy(both: Any, small_heart: Mesh, tmp_path: Path) -> None:
    outer = small_heart.boundary("epicardium")
    path = _file(tmp_path / "o.msh", small_heart, epicardium=outer[:100])
    # Of the mesh the unit alone asks for no surface; what it lacks is somebody who gives its fibres.
    given = "units={f: {unit: fiber_generator}}"
    _refused(both, path, "faces of the surface", sets=(given, "output.probes_mm={}"))
    shown, *_ = both(path, "units={e: {unit: eikonal, parameters: {stimulus_depth_mm: 5}}}")
    assert shown.code == 2
    assert "units.e: no output feeds its input 'fiber'" in shown.err
    assert "surface" not in shown.err


def test_what_was_left_out_is_told_by_show_and_run(both: Any, small_heart: Mesh, tmp_path: Path) -> None:
    lv, rv = small_heart.boundary("lv_endocardium"), small_heart.boundary("rv_endocardium")
    points = np.vstack([small_heart.points, [[1.0, 2.0, 3.0]]])
    path = _file(
        tmp_path / "o.msh", small_heart, points, lv_endocardium=np.vstack([lv, lv]), endocardium=np.vstack([lv, rv])
    )
    shown, ran, summary = both(path)
    expected = [
        "1 of 272 nodes belong to no tetrahedron and were left out",
        "110 faces of the boundary 'lv_endocardium' are listed twice; each was taken once",
        "the boundary 'endocardium' repeats faces of others and is not used",
    ]
    assert summary["warnings"] == [*expected, *FALLBACKS]
    assert (shown.code, ran.code) == (0, 0)
    told = shown.out.partition("\nwarnings\n")[2]
    for text in expected:
        assert text in told
        assert f"warning: {text}\n" in ran.err
    assert summary["lv_volume_ml"]["start"] == pytest.approx(_LV, abs=1e-3)


def test_places_of_units_are_told_with_the_units_name(both: Any, small_heart: Mesh, tmp_path: Path) -> None:
    path = _file(tmp_path / "o.msh", small_heart, small_heart.points * [1.0, 1.0, 0.8])
    _, ran, summary = both(path, "output.probes_mm={}")
    assert ran.code == 0
    for unit in ("fibers", "electrophysiology"):
        assert f"units.{unit}: apex_z_mm is -70, but the lowest point" in " ".join(summary["warnings"])
        assert f"warning: units.{unit}: apex_z_mm is -70" in ran.err


@pytest.mark.parametrize("name", ["garbage.msh", "garbage.vtu", "garbage.med", "garbage"])
def test_garbage_is_refused(name: str, both: Any, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(np.random.default_rng(7).bytes(5000))
    _refused(both, tmp_path / name, "scene", "meshio cannot read it as a mesh")


@pytest.mark.parametrize(
    ("sets", "words"),
    [
        ("scene.scale=feet", ["scene.scale", "mm, cm, m"]),
        ("scene.scale=-1", ["scene.scale", "number from 1e-06"]),
        ("scene.scale=.nan", ["scene.scale"]),
        ("scene.scale=true", ["scene.scale"]),
        ("scene.boundaries={base: 1.5}", ["scene.boundaries.base", "name or the number of a group"]),
        ("scene.boundaries={base: []}", ["scene.boundaries.base"]),
        ("scene.boundaries={base: [true]}", ["scene.boundaries.base"]),
        ("scene.boundaries=[base]", ["scene.boundaries", "section"]),
        (f"scene.boundaries={{base: {'9' * 300}}}", ["scene.boundaries.base", "so many digits"]),
        (f"scene.boundaries={{base: {'x' * 3000}}}", ["scene.boundaries.base", "at most 200 characters"]),
        ("scene.boundaries={bsae: 1}", ["scene.boundaries.bsae", "did you mean 'base'?"]),
        ("scene.boundaries={base: BASE}", ["scene.boundaries.base", "no group of triangles named 'BASE'"]),
        ("scene={geometry: slab, scale: cm}", ["scene", "for the content of a `mesh` file"]),
        ("scene={geometry: slab, boundaries: {base: 1}}", ["scene", "for the content of a `mesh` file"]),
    ],
)
def test_what_makes_no_sense_is_named(sets: str, words: list[str], cosim: Cosim, small_scenario: Path) -> None:
    ended = cosim("show", small_scenario, "--set", sets)
    assert ended.code == 2
    assert len(ended.err) < 1000 + len(sets)
    for word in words:
        assert word in ended.err, ended.err
