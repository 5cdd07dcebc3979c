"""If these fail, two runs pass for nearer or farther from each other than they are, and charts rank them wrongly."""

import json
from collections.abc import Mapping, Sequence
from math import inf, isnan
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.results.comparison import headlines, measures, unit_of
from cardiac_cosim.orchestrator.results.stored_run import StoredRun

_POINTS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
_FINER = np.vstack([_POINTS, 0.5 * (_POINTS[:1] + _POINTS[1:])])


def _stored(
    folder: Path,
    columns: Mapping[str, Sequence[float]],
    activation: Mapping[str, float | None] | None = None,
    fields: Mapping[str, Any] | None = None,
    frames_ms: Sequence[float] = (),
    points: np.ndarray = _POINTS,
    **summary: Any,
) -> StoredRun:
    folder.mkdir()
    rows = [",".join(columns), *(",".join(map(_cell, row)) for row in zip(*columns.values(), strict=True))]
    (folder / "timeseries.csv").write_text("\n".join(rows) + "\n")
    (folder / "summary.json").write_text(json.dumps({"status": "done", "activation_time_ms": activation, **summary}))
    if fields is not None:
        with h5py.File(folder / "fields.h5", "w") as file:
            file["points_mm"], file["frames_ms"] = points, np.array(frames_ms)
            for name, values in fields.items():
                file[f"frames/{name}"] = np.array(values, dtype=float)
    return StoredRun(folder)


def _cell(value: float) -> str:
    return "" if isnan(value) else repr(value)


def test_activation_is_the_largest_difference_at_any_probe(tmp_path: Path) -> None:
    one = _stored(tmp_path / "a", {"time_ms": [0.0]}, {"base": 0.0, "apex": 101.5, "never": None})
    other = _stored(tmp_path / "b", {"time_ms": [0.0]}, {"base": 0.5, "apex": 100.0, "never": None})
    assert measures(other)["activation_ms"].between(one, other).value == 1.5


@pytest.mark.parametrize(("ours", "theirs"), [(None, 100.0), (100.0, None)])
def test_a_probe_that_only_one_of_them_activates_is_infinitely_far_off(
    ours: float | None, theirs: float | None, tmp_path: Path
) -> None:
    one = _stored(tmp_path / "a", {"time_ms": [0.0]}, {"base": 1.0, "apex": ours})
    other = _stored(tmp_path / "b", {"time_ms": [0.0]}, {"base": 1.0, "apex": theirs})
    found = measures(other)["activation_ms"].between(one, other)
    assert found.value == inf
    assert "apex" in found.why


def test_curves_are_compared_where_both_have_a_time_and_a_value(tmp_path: Path) -> None:
    # At 5 ms a line through the coarse one's values is 20 off: it has no value there, so that this does not count.
    coarse = _stored(tmp_path / "a", {"time_ms": [0.0, 10.0, 20.0], "v_ml": [1.0, 4.0, 9.0]})
    fine = _stored(
        tmp_path / "b",
        {"time_ms": [0.0, 5.0, 10.0 + 1e-9, 15.0, 20.0], "v_ml": [1.0, 25.0, 3.0, np.nan, 9.5]},
    )
    assert measures(fine)["v_ml"].between(coarse, fine).value == 1.0
    assert measures(coarse)["v_ml"].between(fine, coarse).value == 1.0
    gaps = _stored(tmp_path / "c", {"time_ms": [0.0, 10.0, 20.0], "v_ml": [1.25, np.nan, 9.5]})
    assert measures(fine)["v_ml"].between(gaps, fine).value == 0.25


@pytest.mark.parametrize("times", [[3.0, 7.0], [], [3.0]])
def test_without_a_time_in_common_nothing_is_compared(times: list[float], tmp_path: Path) -> None:
    one = _stored(tmp_path / "a", {"time_ms": times, "v_ml": times})
    other = _stored(tmp_path / "b", {"time_ms": [0.0, 10.0], "v_ml": [1.0, 2.0]})
    found = measures(other)["v_ml"].between(one, other)
    assert isnan(found.value)
    assert "no time in common" in found.why


def test_fields_differ_by_their_root_mean_square_at_the_worst_time(tmp_path: Path) -> None:
    one = _stored(tmp_path / "a", {"time_ms": [0.0]}, None, {"x_mV": [[0, 0, 0, 0], [2, 0, 0, 0]]}, [0.0, 10.0])
    fields = {"x_mV": [[0, 0, 0, 0], [9, 9, 9, 9], [0, 0, 0, 0]]}
    other = _stored(tmp_path / "b", {"time_ms": [0.0]}, None, fields, [0.0, 5.0, 10.0])
    assert measures(other)["x_mV"].between(one, other).value == 1.0


def test_vectors_count_by_their_length(tmp_path: Path) -> None:
    still, moved = np.zeros((1, 4, 3)), np.zeros((1, 4, 3))
    moved[0, :, 0], moved[0, :, 1] = 3.0, 4.0
    one = _stored(tmp_path / "a", {"time_ms": [0.0]}, None, {"d_mm": np.vstack([still, moved])}, [0.0, 1.0])
    other = _stored(tmp_path / "b", {"time_ms": [0.0]}, None, {"d_mm": np.vstack([still, 2 * moved])}, [0.0, 1.0])
    assert measures(other)["d_mm"].between(one, other).value == 5.0


def test_times_of_events_are_compared_in_the_last_frame(tmp_path: Path) -> None:
    one = _stored(tmp_path / "a", {"time_ms": [0.0]}, None, {"a_time_ms": [[-1] * 4, [1, 2, 3, -1]]}, [0.0, 10.0])
    other = _stored(tmp_path / "b", {"time_ms": [0.0]}, None, {"a_time_ms": [[-1] * 4, [1, 2, 6, -1]]}, [0.0, 10.0])
    assert measures(other)["a_time_ms"].between(one, other).value == pytest.approx(np.sqrt(3.0))
    never = _stored(tmp_path / "c", {"time_ms": [0.0]}, None, {"a_time_ms": [[-1] * 4, [1, 2, 6, 7]]}, [0.0, 10.0])
    assert measures(other)["a_time_ms"].between(never, other).value == inf


def test_nodes_of_a_refined_mesh_are_those_of_the_coarse_one_and_elements_are_not(tmp_path: Path) -> None:
    fields = {"x_mV": [[0] * 4, [1, 1, 1, 1]], "s": [[0.0], [1.0]]}
    coarse = _stored(tmp_path / "a", {"time_ms": [0.0]}, None, fields, [0.0, 1.0])
    fields = {"x_mV": [[0] * 7, [3, 3, 3, 3, 9, 9, 9]], "s": [[0.0] * 8, [1.0] * 8]}
    fine = _stored(tmp_path / "b", {"time_ms": [0.0]}, None, fields, [0.0, 1.0], _FINER)
    assert measures(fine)["x_mV"].between(coarse, fine).value == 2.0
    found = measures(fine)["s"].between(coarse, fine)
    assert isnan(found.value)
    assert "another mesh" in found.why
    moved = _stored(tmp_path / "c", {"time_ms": [0.0]}, None, fields, [0.0, 1.0], _FINER + 0.1)
    assert isnan(measures(moved)["x_mV"].between(coarse, moved).value)


def test_what_never_changes_measures_nothing(tmp_path: Path) -> None:
    columns = {"time_ms": [0.0, 1.0], "rv_volume_ml": [0.0, 0.0], "lv_volume_ml": [3.0, 2.0]}
    fields = {"still_mm": [[1.0] * 4] * 2, "x_mV": [[0.0] * 4, [1.0] * 4]}
    run = _stored(tmp_path / "a", columns, {"base": None}, fields, [0.0, 1.0])
    assert set(measures(run)) == {"lv_volume_ml", "x_mV"}


def test_headlines_are_what_a_run_is_asked_for(tmp_path: Path) -> None:
    columns = {"time_ms": [0.0, 1.0], "lv_volume_ml": [50.0, 20.0], "apex_uplift_mm": [0.0, 3.0], "x": [1.0, 1.0]}
    extents = {name: {"start": v[0], "min": min(v), "max": max(v)} for name, v in columns.items() if name != "time_ms"}
    run = _stored(
        tmp_path / "a", columns, {"base": 1.0, "apex": None}, ejection_fraction={"lv": 0.6, "rv": 0.0}, **extents
    )
    assert headlines(run) == {
        "activation_base_ms": 1.0,
        "lv_volume_min_ml": 20.0,
        "apex_uplift_max_mm": 3.0,
        "lv_ejection_fraction": 0.6,
    }


def test_units_of_measure_are_what_names_end_in() -> None:
    names = ["lv_volume_ml", "potential_base_mV", "stretch", "first.x", "ms"]
    assert [unit_of(name) for name in names] == ["ml", "mV", "", "", "ms"]


def test_a_folder_without_results_has_no_measures(tmp_path: Path) -> None:
    run = StoredRun(tmp_path)
    assert (measures(run), headlines(run), run.time_series().empty, run.coupling().empty) == ({}, {}, True, True)
