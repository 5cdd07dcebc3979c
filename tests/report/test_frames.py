"""If these fail, a person judges a run by pictures of other times than the run had, or of none that matter."""

from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.figures.displacement_snapshots import displacement_snapshots
from cardiac_cosim.report.figures.frames import at_times, greatest_contraction, of_a_beat, of_a_load
from cardiac_cosim.report.figures.potential_snapshots import potential_snapshots
from cardiac_cosim.report.figures.tissue import shares
from stored_body import CUBE_CELLS, CUBE_POINTS, drawn, stored, titles

_POTENTIAL, _DISPLACEMENT = "potential_mV", "displacement_mm"


def _row(folder: Path, *, activation: bool = True, **summary: object) -> StoredRun:
    """Ten cubes in a row, each node excited at 10 ms per mm of x and at rest again 200 ms later, in frames of 20 ms."""
    points = np.concatenate([CUBE_POINTS * [0.1, 0.1, 0.1] + [number, 0.0, 0.0] for number in range(10)])
    cells = np.concatenate([CUBE_CELLS + 8 * number for number in range(10)])
    times = np.arange(0.0, 401.0, 20.0)
    # Both ends of a cube at once, so that a tenth of the tissue follows the other.
    arrival = 10.0 * np.repeat(np.arange(10), 8)
    excited = (arrival <= times[:, None]) & (times[:, None] < arrival + 200.0)
    frames = {_POTENTIAL: np.where(excited, 20.0, -80.0)}
    if activation:
        frames["activation_time_ms"] = np.where(arrival <= times[:, None], arrival, -1.0)
    # The frame nearest to the smallest volume, at 133 ms, is that of 140 ms.
    volumes = "\n".join(f"{time:g},{30.0 + 0.001 * (time - 133.0) ** 2}" for time in np.arange(0.0, 401.0, 7.0))
    series = f"time_ms,lv_volume_ml\n{volumes}\n"
    return stored(folder, points, cells, times=tuple(times), frames=frames, series=series, **summary)


@pytest.mark.parametrize("activation", [True, False])
def test_a_beat_is_shown_where_something_happens(tmp_path: Path, activation: bool) -> None:
    frames = of_a_beat(_row(tmp_path, activation=activation), _POTENTIAL, _DISPLACEMENT)
    # A tenth of the tissue is excited at 0 ms, half of it at 40 ms, nine tenths at 80 ms.
    told = {frame.time_ms: frame.reason for frame in frames}
    assert told.pop(0.0) == "start, 10 % activated"
    assert told.pop(20.0) == "first after the start"
    assert told.pop(40.0) == "50 % activated"
    assert told.pop(80.0) == "90 % activated"
    assert told.pop(140.0) == "greatest contraction"
    assert told.pop(240.0) == "50 % repolarised"
    assert told.pop(280.0) == "90 % repolarised"
    assert told.pop(400.0) == "end of the run"
    # One more fills the last row: in the middle of the longest gap.
    assert told == {340.0: "in between"}
    assert [frame.time_ms for frame in frames] == sorted(frame.time_ms for frame in frames)


def test_a_beat_that_does_not_get_to_rest_is_shown_on_its_way_there(tmp_path: Path) -> None:
    # From 20 mV down to 0 mV, which is far from rest: half-way at 30 ms.
    levels = np.array([-80.0, 20.0, 15.0, 10.0, 4.0, 0.0])
    potential = levels[:, None] * np.ones(len(CUBE_POINTS))
    run = stored(tmp_path, times=tuple(10.0 * np.arange(6)), frames={_POTENTIAL: potential})
    told = {frame.time_ms: frame.reason for frame in of_a_beat(run, _POTENTIAL, _DISPLACEMENT)}
    assert told[30.0] == "repolarising"
    held = stored(tmp_path, times=(0.0, 10.0, 20.0), frames={_POTENTIAL: potential[[0, 1, 1]]})
    assert "repolarising" not in {frame.reason for frame in of_a_beat(held, _POTENTIAL, _DISPLACEMENT)}


def test_the_last_frame_of_a_run_that_was_broken_off_is_not_called_its_end(tmp_path: Path) -> None:
    frames = of_a_beat(_row(tmp_path, status="interrupted"), _POTENTIAL, _DISPLACEMENT)
    assert frames[-1].reason == "last frame"


@pytest.mark.parametrize(("count", "shown"), [(1, 1), (2, 2), (3, 3), (4, 3), (5, 3)])
def test_a_run_of_few_frames_has_no_empty_pictures(tmp_path: Path, count: int, shown: int) -> None:
    # Nothing is excited, so that nothing but the beginning and the end is to be seen.
    potential = np.full((count, len(CUBE_POINTS)), -80.0)
    run = stored(tmp_path, times=tuple(5.0 * np.arange(count)), frames={_POTENTIAL: potential})
    figure = drawn(potential_snapshots(run))
    # Each panel has a title; the colour bar has none.
    assert len(titles(figure)) == shown == len(figure.axes) - 1


def test_times_that_are_asked_for_are_shown_and_no_others(tmp_path: Path) -> None:
    run = _row(tmp_path)
    frames = at_times(run, [345.0, 55.0, 60.0, 5.0])
    assert [(frame.time_ms, frame.reason) for frame in frames] == [
        (0.0, "nearest to 5 ms"),
        (60.0, "nearest to 55 ms"),
        (340.0, "nearest to 345 ms"),
    ]
    assert titles(drawn(potential_snapshots(run, [100.0, 110.0])))[0] == "100 ms"


@pytest.mark.parametrize("time", [-1.0, 401.0])
def test_a_time_outside_the_run_is_refused(tmp_path: Path, time: float) -> None:
    run = _row(tmp_path)
    with pytest.raises(InputError, match=rf"{tmp_path}: no frame of {time:g} ms .* frames from 0 to 400 ms"):
        at_times(run, [time])


def test_contraction_without_cavities_is_the_largest_displacement(tmp_path: Path) -> None:
    moved = np.array([0.0, 2.0, 1.0])[:, None, None] * np.ones((3, len(CUBE_POINTS), 3))
    run = stored(tmp_path, times=(0.0, 5.0, 10.0), frames={_DISPLACEMENT: moved})
    assert greatest_contraction(run, _DISPLACEMENT) == (1, 5.0, "largest displacement")
    still = stored(tmp_path, times=(0.0, 5.0), frames={_DISPLACEMENT: 0.0 * moved[:2]})
    assert greatest_contraction(still, _DISPLACEMENT) is None


def test_a_cavity_that_is_only_filled_does_not_contract(tmp_path: Path) -> None:
    run = stored(tmp_path, times=(0.0, 5.0), series="time_ms,lv_volume_ml\n0,36\n5,40\n")
    assert greatest_contraction(run, _DISPLACEMENT) is None


def test_a_load_is_shown_by_how_far_it_moves_the_tissue(tmp_path: Path) -> None:
    moved = np.array([0.0, 1.0, 2.0, 6.0, 10.0, 9.0])[:, None, None] * np.ones((6, len(CUBE_POINTS), 3))
    run = stored(tmp_path, times=tuple(10.0 * np.arange(6)), frames={_DISPLACEMENT: moved})
    told = {frame.time_ms: frame.reason for frame in of_a_load(run, _DISPLACEMENT)}
    # 6 mm are the first to be more than 40 % of 10 mm, and more than 60 % of it as well.
    largest = "% of the largest displacement"
    assert told == {0.0: "start", 20.0: f"20 {largest}", 30.0: f"40 {largest}", 40.0: "largest displacement"}
    assert len(titles(drawn(displacement_snapshots(run)))) == len(told)


def test_displacements_are_a_picture_of_their_own_where_there_is_no_potential(tmp_path: Path) -> None:
    moved = np.arange(2.0)[:, None, None] * np.ones((2, len(CUBE_POINTS), 3))
    both = {_DISPLACEMENT: moved, _POTENTIAL: np.zeros((2, len(CUBE_POINTS)))}
    assert displacement_snapshots(stored(tmp_path, times=(0.0, 5.0), frames=both)) is None
    assert displacement_snapshots(stored(tmp_path, times=(0.0, 5.0), frames={_DISPLACEMENT: 0.0 * moved})) is None


def test_nodes_count_by_the_tissue_around_them(tmp_path: Path) -> None:
    run = stored(tmp_path)
    # The two ends of the diagonal belong to all six tetrahedra, the others to two each.
    np.testing.assert_allclose(shares(run), [0.25, *[1 / 12] * 6, 0.25])
