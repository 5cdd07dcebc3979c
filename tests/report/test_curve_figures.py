"""If these fail, a person reads a wrong number off a curve, or looks at one of another quantity than its label says."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.cavity_volumes import cavity_volumes
from cardiac_cosim.report.figures.cell_response import cell_response
from cardiac_cosim.report.figures.other_outputs import other_outputs
from cardiac_cosim.report.figures.probe_potential import probe_potential
from cardiac_cosim.report.figures.residuals import residuals
from cardiac_cosim.report.figures.space_time import front_speed, space_time
from cardiac_cosim.report.figures.wall_motion import wall_motion
from matplotlib.axes import Axes
from matplotlib.figure import Figure


def _stored(folder: Path, series: str, **summary: object) -> StoredRun:
    (folder / "timeseries.csv").write_text(series, encoding="utf-8")
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    return StoredRun(folder)


def _names(axis: Axes) -> list[str]:
    return axis.get_legend_handles_labels()[1]


def _drawn(figure: Figure | None) -> Figure:
    assert figure is not None
    return figure


def test_activation_is_marked_where_the_summary_has_it(tmp_path: Path) -> None:
    series = "time_ms,potential_base_mV,potential_apex_mV\n0,-80,-80\n10,20,-80\n20,20,-79\n"
    run = _stored(tmp_path, series, activation_time_ms={"base": 6.0, "apex": None})
    (axis,) = _drawn(probe_potential(run)).axes
    assert _names(axis) == ["base: activated at 6.0 ms", "apex"]
    (mark,) = [line for line in axis.lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(mark.get_xydata(), [[6.0, -20.0]])
    assert axis.get_ylabel() == "transmembrane potential (mV)"


def test_end_systole_is_the_smallest_volume_of_a_cavity_that_ejects(tmp_path: Path) -> None:
    series = "time_ms,lv_volume_ml,rv_volume_ml,third_volume_ml\n0,40,13,0\n10,20,13.5,0\n20,22,14,0\n"
    run = _stored(tmp_path, series, ejection_fraction={"lv": 0.5, "rv": 0.0})
    (axis,) = _drawn(cavity_volumes(run)).axes
    told = "left ventricle: 20.0 ml at end-systole, ejection fraction 0.50"
    assert _names(axis) == [told, "right ventricle"]
    (mark,) = [line for line in axis.lines if line.get_marker() == "v"]
    np.testing.assert_array_equal(mark.get_xydata(), [[10.0, 20.0]])
    assert axis.get_ylim()[0] == 0.0


def test_every_other_column_that_changes_is_drawn_with_those_of_its_unit_of_measure(tmp_path: Path) -> None:
    columns = "time_ms,apex_uplift_mm,a.u,b.y,still,potential_x_mV,lv_volume_ml,twist_deg"
    run = _stored(tmp_path, f"{columns}\n0,0,1,2,3,-80,38,0\n1,0.5,2,1,3,-79,37,4\n")
    millimetres, plain = _drawn(other_outputs(run)).axes
    assert millimetres.get_ylabel() == "apex uplift (mm)"
    assert _names(plain) == ["a.u", "b.y"]
    assert plain.get_xlabel() == "time (ms)"


def test_twist_and_strains_have_panels_of_their_own_units(tmp_path: Path) -> None:
    run = _stored(tmp_path, "time_ms,twist_deg,radial_strain\n0,0,0\n1,-7,0.2\n2,-3,0.1\n")
    twist, strain = _drawn(wall_motion(run)).axes
    assert twist.get_title(loc="left") == "left ventricle: largest twist -7.0° at 1 ms"
    np.testing.assert_allclose(strain.lines[0].get_ydata(), [0.0, 20.0, 10.0])
    assert "%" in strain.get_ylabel()
    assert wall_motion(_stored(tmp_path, "time_ms,twist_deg\n0,0\n1,0\n")) is None


@pytest.mark.parametrize("status", ["done", "failed"])
def test_the_sweeps_of_a_step_that_failed_stand_out(tmp_path: Path, status: str) -> None:
    run = _stored(tmp_path, "time_ms,x\n0,1\n5,1\n", status=status)
    rows = "5.0,1,0.1,\n5.0,2,0.01,0.1\n10.0,1,0.5,\n10.0,2,0.4,0.8\n10.0,3,0.3,0.75\n"
    (tmp_path / "iterations.csv").write_text(f"time_ms,iteration,residual_m.stretch,contraction_rate\n{rows}")
    (axis,) = _drawn(residuals(run)).axes
    assert axis.get_ylabel() == "residual of\nm.stretch"
    lines = [line.get_xydata().tolist() for line in axis.lines]
    assert lines == [[[1.0, 0.1], [2.0, 0.01]], [[1.0, 0.5], [2.0, 0.4], [3.0, 0.3]]]
    assert [line.get_linestyle() for line in axis.lines] == ["-", "--" if status == "failed" else "-"]
    assert ("which failed" in axis.get_title(loc="left")) == (status == "failed")


def test_a_run_that_iterated_nothing_has_no_residuals(tmp_path: Path) -> None:
    assert residuals(_stored(tmp_path, "time_ms,x\n0,1\n")) is None


def _fields(folder: Path, points: np.ndarray, times: list[float], **frames: np.ndarray) -> StoredRun:
    with h5py.File(folder / "fields.h5", "w") as file:
        file["points_mm"], file["frames_ms"] = points, np.array(times)
        for name, values in frames.items():
            file[f"frames/{name}"] = values
    return StoredRun(folder)


def test_the_speed_of_a_wave_along_a_strand(tmp_path: Path) -> None:
    # Nodes stand in the file in any order; the ends have waves of other speeds.
    place = np.array([40.0, 0.0, 10.0, 50.0, 20.0, 30.0, 60.0, 35.0, 45.0])
    times = place / 0.6
    points = np.stack([place, 0 * place, 0 * place], axis=1)
    frames = np.where(times < np.array([[0.0], [200.0]]), 20.0, -80.0)
    run = _fields(tmp_path, points, [0.0, 200.0], potential_mV=frames, activation_time_ms=np.stack([times, times]))
    axis = _drawn(space_time(run)).axes[0]
    assert axis.get_title(loc="left") == "dashed: the front of the wave, 0.600 mm/ms away from the ends"
    np.testing.assert_allclose(axis.lines[0].get_xdata(), np.sort(place))


def test_no_speed_where_there_is_no_wave() -> None:
    place = np.linspace(0.0, 60.0, 13)
    assert front_speed(place, np.zeros(13)) is None
    assert front_speed(place[:2], np.array([0.0, 1.0])) is None
    # The ends do not count: a stimulus that is everywhere at once, a wave that meets the border.
    assert front_speed(place, np.where(place < 20.0, 0.0, place / 0.5)) == pytest.approx(0.5)


def test_a_cell_and_its_upstroke_have_the_same_values(tmp_path: Path) -> None:
    frames = {"potential_mV": np.array([[-10.0], [20.0], [-80.0]]), "stretch": np.array([[1.0], [0.8], [1.0]])}
    run = _fields(tmp_path, np.zeros((1, 3)), [0.0, 10.0, 400.0], **frames)
    figure = _drawn(cell_response(run))
    assert [axis.get_ylabel() for axis in figure.axes] == ["transmembrane\npotential (mV)", "", "fibre stretch (–)", ""]
    for axis in figure.axes[:2]:
        np.testing.assert_array_equal(axis.lines[0].get_xydata(), [[0.0, -10.0], [10.0, 20.0], [400.0, -80.0]])
    assert figure.axes[1].get_xlim() == (0.0, 20.0)
    strand = _fields(tmp_path, np.eye(3), [0.0, 1.0], potential_mV=np.zeros((2, 3)))
    assert cell_response(strand) is None
    assert space_time(strand) is None
