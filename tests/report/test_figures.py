"""If these fail, a run is judged by figures that are missing, of another run, or of data that it does not have."""

import struct
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.draw import FIGURES, draw_figures, draw_still
from cardiac_cosim.report.figures.pressure_volume import pressure_volume
from stored_body import CUBE_CELLS, CUBE_POINTS, stored

_PNG_START = b"\x89PNG"
_STILL = ["geometry", "boundaries", "transmural_directions", "fiber_layout", "stimulus"]
_IN_TIME = ["potential_snapshots", "activation_map"]
_CURVES = ["potential_at_probes", "cavity_volumes", "pressure_volume"]


def _write_fields(folder: Path, times: tuple[float, ...], *without: str, prefix: str = "") -> None:
    nodes, elements = len(CUBE_POINTS), len(CUBE_CELLS)
    # Two nodes begin, and the last node is activated last.
    potential = np.linspace(-80.0, 20.0, len(times) * nodes).reshape(len(times), nodes)
    potential[:1] = np.where(np.arange(nodes) < 2, -10.0, -80.0)
    fixed = {"fiber": np.tile([1.0, 0.0, 0.0], (elements, 1)), "sheet": np.tile([0.0, 1.0, 0.0], (elements, 1))}
    frames = {
        f"{prefix}potential_mV": potential,
        "displacement_mm": 0.1 * np.arange(len(times))[:, None, None] * np.ones((1, nodes, 3)),
        "activation_time_ms": np.tile(np.arange(nodes) - 1.0, (len(times), 1)),
    }
    stored(
        folder,
        times=times,
        fixed={name: values for name, values in fixed.items() if name not in without},
        frames={name: values for name, values in frames.items() if name not in without},
        boundaries={} if "boundaries" in without else {"epicardium": np.array([[2, 3, 7], [2, 7, 6]])},
    )


def _write_series(folder: Path, text: str) -> None:
    (folder / "timeseries.csv").write_text(text, encoding="utf-8")


def _names(drawn: list[Path]) -> list[str]:
    return [path.stem for path in drawn]


def test_every_figure_is_drawn_from_what_a_run_leaves(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0, 5.0))
    columns = "time_ms,potential_apex_mV,lv_volume_ml,lv_pressure_kPa"
    _write_series(tmp_path, f"{columns}\n0.0,-80.0,38.0,0.0\n5.0,-79.0,37.5,0.1\n")
    drawn = draw_figures(tmp_path)
    assert _names(drawn) == [*_STILL, *_IN_TIME, *_CURVES, "other_outputs"]
    for path in drawn:
        assert path.parent == tmp_path / "figures"
        assert path.read_bytes().startswith(_PNG_START)
        assert path.stat().st_size > 5000
        # As many pixels across as a page is wide, whatever the height.
        assert struct.unpack(">I", path.read_bytes()[16:20]) == (1280,)


def test_pressure_is_drawn_over_the_volume_of_its_own_cavity(tmp_path: Path) -> None:
    # Gaps are of units that step less often; a pressure that nobody changes makes no curve.
    names = "time_ms,lv_volume_ml,rv_pressure_kPa,lv_pressure_kPa,rv_volume_ml"
    _write_series(tmp_path, f"{names}\n0.0,38.0,1.0,0.0,12.0\n5.0,,1.0,0.5,13.0\n9.0,40.0,1.0,1.5,14.0\n")
    figure = pressure_volume(StoredRun(tmp_path))
    assert figure is not None
    curve, begin = figure.axes[0].lines
    assert curve.get_label() == "left ventricle; the dot is the beginning"
    np.testing.assert_array_equal(curve.get_xydata(), [[38.0, 0.0], [40.0, 1.5]])
    np.testing.assert_array_equal(begin.get_xydata(), [[38.0, 0.0]])


@pytest.mark.parametrize(
    ("without", "columns", "expected"),
    [
        (("fiber", "sheet", "boundaries"), "potential_apex_mV", ["geometry", "stimulus", *_IN_TIME, _CURVES[0]]),
        (("sheet", "displacement_mm"), "lv_volume_ml", [*_STILL[:2], *_STILL[3:], *_IN_TIME, _CURVES[1]]),
        (("potential_mV", "activation_time_ms"), "apex_uplift_mm", _STILL[:4]),
        (("activation_time_ms",), "apex_uplift_mm", [*_STILL, "potential_snapshots"]),
    ],
)
def test_a_figure_without_data_is_skipped(
    tmp_path: Path, without: tuple[str, ...], columns: str, expected: list[str]
) -> None:
    _write_fields(tmp_path, (0.0,), *without)
    _write_series(tmp_path, f"time_ms,{columns}\n0.0,1.0\n")
    run = StoredRun(tmp_path)
    assert [name for name, draw in FIGURES.items() if draw(run) is not None] == expected


def test_what_is_known_at_the_begin_is_drawn_then(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0,))
    still = draw_still(tmp_path, "heading")
    assert list(still) == _STILL
    assert all(picture.startswith(_PNG_START) for picture in still.values())
    _write_fields(tmp_path, (0.0, 5.0))
    for path in draw_figures(tmp_path, still):
        assert path.stem not in still or path.read_bytes() == still[path.stem]


def test_a_long_heading_takes_nothing_from_the_picture(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0,), "fiber", "sheet", "boundaries", "potential_mV")
    short, long = (draw_still(tmp_path, "x" * letters)["geometry"] for letters in (10, 150))
    heights = [struct.unpack(">I", picture[20:24])[0] for picture in (short, long)]
    # Two lines more of 11 points at 200 pixels an inch.
    assert 50 < heights[1] - heights[0] < 100


def test_the_times_of_pictures_can_be_asked_for(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0, 5.0, 10.0), "fiber", "sheet", "boundaries", "activation_time_ms", "displacement_mm")
    chosen = {path.stem: path.read_bytes() for path in draw_figures(tmp_path)}
    asked = {path.stem: path.read_bytes() for path in draw_figures(tmp_path, times_ms=[5.0])}
    assert [name for name in chosen if chosen[name] != asked[name]] == ["potential_snapshots"]
    with pytest.raises(InputError, match="no frame of 11 ms can be shown"):
        draw_figures(tmp_path, times_ms=[11.0])


def test_a_folder_without_a_run_has_no_figures_and_a_run_that_failed_at_once_the_body(tmp_path: Path) -> None:
    assert draw_figures(tmp_path) == []
    assert not (tmp_path / "figures").exists()
    _write_fields(tmp_path, (), "fiber", "sheet", "boundaries")
    _write_series(tmp_path, "time_ms,potential_apex_mV,lv_volume_ml\n")
    assert _names(draw_figures(tmp_path)) == ["geometry"]


def test_no_figure_of_an_earlier_run_stays(tmp_path: Path) -> None:
    _write_series(tmp_path, "time_ms,lv_volume_ml\n0.0,38.0\n")
    (old,) = draw_figures(tmp_path)
    _write_series(tmp_path, "time_ms,active_stress_mean_kPa\n0.0,0.0\n")
    assert draw_figures(tmp_path) == []
    assert not old.exists()


def test_a_run_reads_back_as_written(tmp_path: Path) -> None:
    _write_fields(tmp_path, (0.0, 5.0), prefix="electrophysiology.")
    _write_series(tmp_path, "time_ms,potential_apex_mV\n0.0,-80.0\n1.0,\n2.0")
    run = StoredRun(tmp_path)
    second = run.frame("potential_mV", 1)
    assert second is not None
    assert second[-1] == 20.0
    assert run.frame("potential_mV", 2) is None
    assert run.initial("fibre") is None
    np.testing.assert_array_equal(run.columns["potential_apex_mV"], [-80.0, np.nan])
    assert run.end_ms == 5.0
