"""If these fail, a person is told that two runs differ elsewhere, at another time or by another amount than they do."""

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.report.comparison.compared import opened
from cardiac_cosim.report.comparison.comparison_page import write_page
from cardiac_cosim.report.comparison.comparison_table import write_table
from cardiac_cosim.report.comparison.differences import differences
from cardiac_cosim.report.comparison.side_by_side import side_by_side


def _run(folder: Path, volumes: list[float], apex_ms: float | None, step_ms: float, **more: object) -> Path:
    folder.mkdir(parents=True)
    times = [float(10 * row) for row in range(len(volumes))]
    rows = "".join(f"{time},{volume}\n" for time, volume in zip(times, volumes, strict=True))
    (folder / "timeseries.csv").write_text(f"time_ms,lv_volume_ml\n{rows}")
    summary = {
        "status": "done",
        "activation_time_ms": {"apex": apex_ms},
        "lv_volume_ml": {"start": volumes[0], "min": min(volumes), "max": max(volumes), "end": volumes[-1]},
        "scenario": {"name": "heart", "coupling": {"step_ms": step_ms, "scheme": "jacobi"}},
        "fingerprints": {"program": "same"},
    }
    (folder / "summary.json").write_text(json.dumps(summary | more))
    with h5py.File(folder / "fields.h5", "w") as file:
        file["points_mm"], file["frames_ms"] = np.eye(4, 3), [0.0, 20.0]
        file["frames/potential_mV"] = np.array([[-80.0] * 4, [volumes[-1]] * 4])
    return folder


@pytest.fixture
def pair(tmp_path: Path) -> list[Path]:
    one = _run(tmp_path / "one", [40.0, 30.0, 20.0], 100.0, 1.0)
    return [one, _run(tmp_path / "<b>two", [40.0, 33.0, 21.0], None, 5.0)]


def _rows(path: Path) -> dict[str, dict[str, str]]:
    with path.open(newline="") as file:
        return {row["quantity"]: row for row in csv.DictReader(file)}


def test_every_difference_is_in_the_table_with_its_moment(pair: list[Path], tmp_path: Path) -> None:
    rows = _rows(write_table(differences(opened(pair)), tmp_path))
    volume = rows["lv_volume_ml"]
    assert (volume["run"], volume["unit"], float(volume["difference"]), float(volume["time_ms"])) == (
        "<b>two", "ml", 3.0, 10.0
    )  # fmt: skip
    smallest = rows["lv_volume_min_ml"]
    assert [float(smallest[name]) for name in ("reference", "value", "difference")] == [20.0, 21.0, 1.0]
    field = rows["potential_mV"]
    assert (float(field["difference"]), float(field["time_ms"])) == (1.0, 20.0)
    # An event that only one of them has is infinitely far off, and no number is made up for it.
    assert rows["activation_ms"]["difference"] == "inf"
    assert "apex" in rows["activation_ms"]["why"]
    assert rows["activation_apex_ms"]["value"] == rows["activation_apex_ms"]["difference"] == ""
    assert "only the run one has it" in rows["activation_apex_ms"]["why"]


def test_a_run_does_not_differ_from_its_copy(tmp_path: Path) -> None:
    same = [_run(tmp_path / name / "heart", [40.0, 30.0], 100.0, 1.0) for name in ("a", "b")]
    compared = opened(same)
    assert list(compared.runs) == ["a/heart", "b/heart"]
    assert compared.settings == {}
    found = [row["difference"] for row in _rows(write_table(differences(compared), tmp_path)).values()]
    assert {float(each) for each in found} == {0.0}


def test_settings_that_differ_are_named_and_others_are_not(pair: list[Path]) -> None:
    assert opened(pair).settings == {"coupling.step_ms": [1.0, 5.0]}


def test_a_run_that_failed_and_another_version_are_said(tmp_path: Path) -> None:
    done = _run(tmp_path / "done", [40.0, 30.0], None, 1.0)
    failed = _run(tmp_path / "failed", [40.0], None, 1.0, status="failed", fingerprints={"program": "other"})
    one, other = opened([done, failed]).notes
    assert "failed is not complete (failed): it ended at 20 ms" in one
    assert "different versions" in other


def test_the_page_shows_what_names_say_and_runs_nothing_of_it(pair: list[Path], tmp_path: Path) -> None:
    compared = opened(pair)
    page = write_page(compared, differences(compared), tmp_path, "one and <b>two").read_text()
    assert "<b>two" not in page
    assert "&lt;b&gt;two" in page
    assert "lv volume<br>(ml)" in page.replace("\\u003c", "<").replace("\\u003e", ">")
    assert "http-equiv" in page
    assert 'src="http' not in page


@pytest.mark.parametrize("case", ["one", "twice", "nothing"])
def test_what_cannot_be_compared_is_refused_with_a_remedy(case: str, pair: list[Path], tmp_path: Path) -> None:
    folders = {"one": pair[:1], "twice": [pair[0], pair[0]], "nothing": [pair[0], tmp_path]}[case]
    with pytest.raises(InputError, match="give"):
        opened(folders)


def test_bodies_are_side_by_side_at_times_that_all_runs_have(tmp_path: Path) -> None:
    runs = []
    for name, times in (("one", [0.0, 5.0, 10.0]), ("two", [0.0, 10.0, 20.0])):
        folder = _run(tmp_path / name, [40.0, 30.0], None, 1.0)
        with h5py.File(folder / "fields.h5", "w") as file:
            file["points_mm"], file["cells"] = np.vstack([np.zeros(3), 10.0 * np.eye(3)]), [[0, 1, 2, 3]]
            file["frames_ms"] = times
            file["frames/potential_mV"] = np.linspace(-80.0, 20.0, 12).reshape(3, 4)
        runs.append(folder)
    compared = opened(runs)
    picture = side_by_side(compared)
    assert picture is not None
    assert picture.startswith(b"\x89PNG")
    page = write_page(compared, differences(compared), tmp_path, "title").read_text()
    assert "data:image/png;base64," in page
    # With no time in common there is nothing to put side by side, and no picture of different moments.
    with h5py.File(runs[1] / "fields.h5", "a") as file:
        file["frames_ms"][:] = [0.0, 11.0, 21.0]
    assert side_by_side(opened(runs)) is None
