"""If these fail, a map of activation says other times or speeds than the wave had."""

from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.participants.participant import Values
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.activation_map import activation_map
from cardiac_cosim.report.figures.conduction_speed import conduction_speeds
from cardiac_cosim.report.figures.isochrones import NOT_ACTIVATED, isochrones
from cardiac_cosim.report.figures.potential_snapshots import potential_snapshots
from cardiac_cosim.report.figures.skin import Skin
from cardiac_cosim.report.figures.viewpoints import FRONT, long_axis
from cardiac_cosim.units.geometry.grid import sheet
from stored_body import CUBE_POINTS, drawn, stored, titles

_TURNED = np.deg2rad(30.0)


@pytest.mark.parametrize(
    ("last", "first", "width", "bands"),
    [(135.4, 0.0, 10.0, 14), (47.9, 0.0, 5.0, 10), (140.0, 140.0 - 13.9, 1.0, 15), (0.31, 0.0, 0.1, 4)],
)
def test_bands_have_a_round_width_and_hold_all_times(last: float, first: float, width: float, bands: int) -> None:
    found = isochrones(np.array([first, np.nan, last]))
    assert found is not None
    np.testing.assert_allclose(np.diff(found.levels_ms), width)
    assert len(found.levels_ms) == bands + 1
    assert found.levels_ms[0] <= first < found.levels_ms[1]
    assert found.levels_ms[-2] <= last < found.levels_ms[-1]


def test_without_a_wave_there_is_no_map(tmp_path: Path) -> None:
    assert isochrones(np.array([3.0, 3.0, np.nan])) is None
    assert isochrones(np.array([np.nan])) is None
    never = {"activation_time_ms": np.full((1, len(CUBE_POINTS)), -1.0)}
    assert activation_map(stored(tmp_path, times=(0.0,), frames=never)) is None
    assert activation_map(stored(tmp_path, times=(0.0,))) is None


def test_tissue_that_was_not_activated_is_grey_and_nothing_else_is(tmp_path: Path) -> None:
    mesh = stored(tmp_path).mesh
    assert mesh is not None
    times = 9.9 * CUBE_POINTS[:, 2]
    times[CUBE_POINTS[:, 2] == 0.0] = np.nan
    # All elements reach down to Z = 0, and no face above it does.
    bands = isochrones(9.9 * CUBE_POINTS[:, 2])
    assert bands is not None
    skin, view = Skin(mesh), long_axis(mesh.points)
    (face,), _ = skin.cut(view, times, bands.colors, bands.inner)
    np.testing.assert_allclose(face.rgb, np.tile(NOT_ACTIVATED, (len(face.rgb), 1)))
    (face,), _ = skin.cut(view, 9.9 * CUBE_POINTS[:, 2], bands.colors, bands.inner)
    assert not np.isclose(face.rgb, NOT_ACTIVATED).all(axis=1).any()
    assert len(np.unique(face.rgb, axis=0)) == len(bands.levels_ms) - 1
    # No line ends in what has no time.
    on_skin, on_cut = skin.lines(FRONT, times, bands.inner)
    assert len(on_skin.corners) == len(on_cut.corners) == 0


def test_probes_are_marked_where_they_are(tmp_path: Path) -> None:
    frames = {"activation_time_ms": CUBE_POINTS[None, :, 2]}
    scenario = {"output": {"probes_mm": {"middle": [4.0, 5.0, 6.0], "edge": [10.0, 0.0, 10.0]}}}
    figure = drawn(activation_map(stored(tmp_path, times=(9.0,), frames=frames, scenario=scenario)))
    assert titles(figure) == ["from the front", "from behind", "long-axis section", "short-axis section, from above"]
    section = figure.axes[2]
    # The section is that of Y = 5 mm, seen from the front; the other probe does not lie in it.
    assert [text.get_text() for text in section.texts] == ["middle"]
    np.testing.assert_allclose(section.lines[0].get_xydata(), [[4.0, 6.0]])


def _sheet(folder: Path, times: Values, fiber: Values) -> StoredRun:
    mesh = sheet(1.5)
    frames = {"activation_time_ms": times[None], "potential_mV": np.where(times < 50.0, 20.0, -80.0)[None]}
    fixed = {"fiber": np.tile(fiber, (mesh.elements, 1))}
    scenario = {"output": {"probes_mm": {"far": [40.0, 10.0, 0.0]}}}
    return stored(folder, mesh.points, mesh.cells, times=(100.0,), fixed=fixed, frames=frames, scenario=scenario)


def _elliptic(points: Values, fiber: Values, along: float, across: float) -> Values:
    """Arrival times of a wave from the origin, the middle of the left edge."""
    parallel = points @ fiber
    return np.sqrt((parallel / along) ** 2 + ((points**2).sum(axis=1) - parallel**2) / across**2)


@pytest.mark.parametrize("speeds", [(0.6, 0.3), (0.3, 0.6), (0.55, 0.5)])
def test_both_speeds_of_an_elliptic_wave_are_found(speeds: tuple[float, float]) -> None:
    mesh, fiber = sheet(1.5), np.array([np.cos(_TURNED), np.sin(_TURNED), 0.0])
    times = _elliptic(mesh.points, fiber, *speeds)
    found = conduction_speeds(mesh.points, mesh.cells, np.tile(fiber, (mesh.elements, 1)), times)
    assert found is not None
    np.testing.assert_allclose(found, speeds, rtol=0.01)


def test_what_a_wave_does_not_show_is_not_said() -> None:
    mesh, fiber = sheet(3.0), np.array([1.0, 0.0, 0.0])
    fibers = np.tile(fiber, (mesh.elements, 1))
    # A plane wave along the fibres has no speed across them.
    assert conduction_speeds(mesh.points, mesh.cells, fibers, mesh.points[:, 0] / 0.5) is None
    assert conduction_speeds(mesh.points, mesh.cells, fibers, np.full(mesh.nodes, np.nan)) is None


def test_a_sheet_shows_its_isochrones_probes_and_speeds(tmp_path: Path) -> None:
    fiber = np.array([1.0, 0.0, 0.0])
    times = _elliptic(sheet(1.5).points, fiber, 0.6, 0.3)
    figure = drawn(activation_map(_sheet(tmp_path, np.where(times < 90.0, times, -1.0), fiber)))
    (title,) = titles(figure)
    assert title.startswith("speed along the fibres 0.60 m/s, across them 0.30 m/s")
    axis = figure.axes[0]
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("X (mm)", "Y (mm)")
    np.testing.assert_allclose(axis.lines[0].get_xydata(), [[40.0, 10.0]])
    assert figure.axes[1].get_xlabel() == "activation time (ms)"
    (grey,) = [text.get_text() for text in figure.texts]
    assert grey == "grey: not activated by 100 ms"


def test_a_sheet_has_snapshots_of_its_potential(tmp_path: Path) -> None:
    fiber = np.array([1.0, 0.0, 0.0])
    figure = drawn(potential_snapshots(_sheet(tmp_path, sheet(1.5).points[:, 0], fiber)))
    assert titles(figure) == ["100 ms: start, 10 % activated, 50 % activated, 90 % activated"]
    assert figure.axes[-1].get_xlabel() == "transmembrane potential (mV)"
