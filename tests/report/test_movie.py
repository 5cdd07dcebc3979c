"""If these fail, a movie lacks frames, shows another moment than it says, or cannot be played."""

import io
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.report.movie.field import MovieField
from cardiac_cosim.report.movie.movie import write_movie
from cardiac_cosim.report.movie.picture import Picture
from imageio_ffmpeg import count_frames_and_secs
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

_TIMES = [0.0, 5.0, 10.0]


def _stored(folder: Path, points: np.ndarray, cells: list[list[int]], **more: np.ndarray) -> StoredRun:
    folder.mkdir()
    frames = len(_TIMES)
    with h5py.File(folder / "fields.h5", "w") as file:
        file["points_mm"], file["cells"], file["frames_ms"] = points, np.array(cells), np.array(_TIMES)
        file["frames/potential_mV"] = np.linspace(-80.0, 20.0, frames * len(points)).reshape(frames, -1)
        file["frames/stretch"] = np.linspace(1.0, 0.8, frames * len(cells)).reshape(frames, -1)
        for name, values in more.items():
            file[f"frames/{name}"] = values
    (folder / "timeseries.csv").write_text("time_ms,potential_apex_mV\n0,-80\n5,-30\n10,20\n")
    return StoredRun(folder)


@pytest.fixture
def solid(tmp_path: Path) -> StoredRun:
    points = np.vstack([np.zeros(3), 10.0 * np.eye(3)])
    moved = np.array([0.0, 1.0, 3.0])[:, None, None] * np.ones((1, 4, 3))
    return _stored(tmp_path / "solid", points, [[0, 1, 2, 3]], displacement_mm=moved)


def test_a_movie_has_every_stored_frame_and_lasts_as_long_as_they_do(solid: StoredRun, tmp_path: Path) -> None:
    path = tmp_path / "movie.mp4"
    done: list[tuple[int, int]] = []
    write_movie(solid, path, None, 5, lambda *count: done.append(count))
    assert count_frames_and_secs(str(path)) == (3, pytest.approx(0.6, abs=0.01))
    assert done == [(1, 3), (2, 3), (3, 3)]
    gif = tmp_path / "movie.gif"
    write_movie(solid, gif, "stretch", 5)
    with Image.open(gif) as image:
        assert (image.n_frames, image.info["duration"]) == (3, 200)  # type: ignore[attr-defined]
    assert sorted(each.name for each in tmp_path.iterdir()) == ["movie.gif", "movie.mp4", "solid"]


def test_a_frame_says_its_time_and_the_cursor_stands_there(solid: StoredRun) -> None:
    picture = Picture(MovieField.of(solid, None))
    FigureCanvasAgg(picture.figure)
    seen = []
    for frame in (0, 2):
        picture.show(frame)
        content = io.BytesIO()
        picture.figure.savefig(content, format="png", dpi=40)
        seen.append(content.getvalue())
    assert seen[0] != seen[1]
    assert "10 ms" in [text.get_text() for text in picture.figure.texts]
    (cursor,) = [line for axis in picture.figure.axes for line in axis.lines if len(set(line.get_xdata())) == 1]
    assert set(cursor.get_xdata()) == {10.0}
    # Colours mean the same in all frames.
    assert picture._colors.get_clim() == (-80.0, 20.0)


_LINE = [[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]]
_TRIANGLE = [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]]


@pytest.mark.parametrize(("nodes", "cells"), [(_TRIANGLE, [[0, 1, 2]]), (_LINE, [[0, 1], [1, 2]])])
def test_sheets_and_strands_are_filmed_too(nodes: list[list[float]], cells: list[list[int]], tmp_path: Path) -> None:
    points = np.array(nodes)
    run = _stored(tmp_path / "run", points, cells)
    for field in ("potential", "stretch"):
        write_movie(run, tmp_path / f"{field}.gif", field)
        with Image.open(tmp_path / f"{field}.gif") as image:
            assert image.n_frames == 3  # type: ignore[attr-defined]


def test_a_field_of_elements_is_shown_as_its_means_around_the_nodes(solid: StoredRun) -> None:
    np.testing.assert_allclose(MovieField.of(solid, "stretch").at(2), 0.8)
    assert MovieField.of(solid, None).label == "transmembrane potential (mV)"


@pytest.mark.parametrize(
    ("name", "field", "told"),
    [
        ("movie.avi", None, r"\.mp4 or \.gif"),
        ("movie", None, r"\.mp4 or \.gif"),
        ("movie.gif", "strech", "did you mean 'stretch'"),
    ],
)
def test_what_cannot_be_filmed_is_refused_with_a_remedy(
    name: str, field: str | None, told: str, solid: StoredRun, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=told):
        write_movie(solid, tmp_path / name, field)
    assert not (tmp_path / name).exists()


def test_a_single_place_and_a_folder_without_frames_are_refused(tmp_path: Path) -> None:
    cell = _stored(tmp_path / "cell", np.zeros((1, 3)), [[0]])
    with pytest.raises(InputError, match="single place"):
        write_movie(cell, tmp_path / "movie.gif")
    with pytest.raises(InputError, match="no stored frames"):
        write_movie(StoredRun(tmp_path), tmp_path / "movie.gif")
