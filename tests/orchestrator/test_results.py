"""If these fail, scripts and ParaView no longer find or read what a run left behind, or a failing run takes the good
steps with it."""

import csv
import itertools
import json
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.master import Accepted
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.native import Mesh
from cardiac_cosim.orchestrator.probes import Probes
from cardiac_cosim.orchestrator.results.coupling_log import CouplingLog
from cardiac_cosim.orchestrator.results.fields import Fields
from cardiac_cosim.orchestrator.results.origin import Origin
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.results.summary import crossing_time, write_summary
from cardiac_cosim.orchestrator.results.table import Table
from cardiac_cosim.orchestrator.results.time_series import TimeSeries
from cardiac_cosim.orchestrator.run import Outcome, run_scenario
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario

_PROBES = {"base": [25.0, 0.0, -1.0], "apex": [0.0, 0.0, -60.0]}


def _scenario(mesh: Path, **changes: Any) -> Scenario:
    content: dict[str, Any] = {
        "name": "small",
        "scene": {"mesh": str(mesh)},
        "units": {
            "fibers": {"unit": "fiber_generator"},
            "electrophysiology": {"unit": "electrophysiology", "parameters": {"stimulus_depth_mm": 5.0}},
            "active_stress": {"unit": "active_stress"},
            "mechanics": {"unit": "mechanics"},
        },
        "run": {"stop_ms": 7.0, "participants": "native"},
        "output": {"every_ms": 3.0, "probes_mm": _PROBES},
    }
    return Scenario.model_validate(content | changes)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory, small_heart_file: Path) -> Outcome:
    return run_scenario(_scenario(small_heart_file), Path(), tmp_path_factory.mktemp("done"))


def _rows(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    return header, np.array([[float(cell or "nan") for cell in row] for row in rows]).reshape(-1, len(header))


def _json(path: Path) -> Any:
    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


# --- timeseries.csv and coupling.csv ------------------------------------------------------------------------------


def test_the_time_series_has_the_columns_of_the_contract_and_a_row_per_step(done: Outcome) -> None:
    header, rows = _rows(done.folder / "timeseries.csv")
    assert header == [
        "time_ms",
        "potential_base_mV",
        "potential_apex_mV",
        "lv_volume_ml",
        "rv_volume_ml",
        "apex_uplift_mm",
        "twist_deg",
        "radial_strain",
        "circumferential_strain",
        "longitudinal_strain",
        "active_stress_mean_kPa",
    ]
    assert rows[:, 0].tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert np.isfinite(rows).all()
    # Plausible numbers under the right headings: rest and its depolarisation in mV, a heart's cavities in ml.
    assert rows[-1, 1] > 0.0 > -79.0 > rows[-1, 2]
    assert 40.0 > rows[0, 3] > rows[0, 4] > 10.0
    assert rows[0, 5] == rows[0, 6] == 0.0
    assert rows[-1, 6] > 0.0


def test_the_time_series_agrees_with_the_fields(done: Outcome, small_heart: Mesh) -> None:
    header, rows = _rows(done.folder / "timeseries.csv")
    with h5py.File(done.folder / "fields.h5") as file:
        at = [round(time) for time in file["frames_ms"][:]]
        probes = Probes(small_heart, _PROBES)
        for frame, row in enumerate(at):
            assert probes(file["frames/potential_mV"][frame]) == rows[row, 1:3].tolist()
            assert (
                float(file["frames/active_stress_kPa"][frame].mean())
                == rows[row, header.index("active_stress_mean_kPa")]
            )
            lowest = small_heart.points[:, 2].argmin()
            assert float(file["frames/displacement_mm"][frame][lowest, 2]) == rows[row, header.index("apex_uplift_mm")]


def test_the_coupling_log_has_the_columns_of_the_contract_and_a_row_per_step(done: Outcome) -> None:
    header, rows = _rows(done.folder / "coupling.csv")
    assert header == [
        "time_ms",
        "step_ms",
        "iterations",
        "contraction_rate",
        "growth_mechanics.stretch",
        "growth_electrophysiology.potential",
        "growth_active_stress.active_stress",
        "rejected",
        "seconds_electrophysiology",
        "seconds_active_stress",
        "seconds_mechanics",
        "seconds_master",
    ]
    assert rows[:, 0].tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert (rows[:, 1] == 1.0).all()
    assert (rows[:, 2] == 1.0).all()
    assert np.isnan(rows[:, 3]).all()
    # With three values nothing is known of an alternation yet, and a sound run has none.
    assert np.isnan(rows[:2, 4:7]).all()
    assert (rows[2:, 5] == 0.0).all()
    assert (rows[:, 7] == 0.0).all()
    assert (rows[:, 8:] >= 0.0).all()
    assert (rows[:, 8:11] > 0.0).all()


def test_numbers_come_back_from_csv_to_the_last_bit(tmp_path: Path) -> None:
    values = [0.1, 1 / 3, -80.0, 1e-300, 5e-324, 1.7976931348623157e308, math.pi, -0.0, 123456789.12345678]
    values += np.random.default_rng(7).standard_normal(200).tolist()
    table = Table(tmp_path / "t.csv", ["a", "b"])
    for value in values:
        table.add([value, None])
    # Read before it is closed: every row is on disk as soon as it is added.
    with (tmp_path / "t.csv").open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    assert [float(first).hex() for first, _ in rows] == [value.hex() for value in values]
    assert {second for _, second in rows} == {""}
    table.close()


def test_numbers_of_numpy_are_written_as_numbers(tmp_path: Path) -> None:
    table = Table(tmp_path / "t.csv", ["a", "b"])
    table.add([np.float64(0.1), np.int64(3)])
    table.close()
    assert (tmp_path / "t.csv").read_text().splitlines()[1] == "0.1,3"


def test_a_results_file_that_cannot_be_written_is_the_persons_to_mend(tmp_path: Path, small_heart: Mesh) -> None:
    (tmp_path / "timeseries.csv").mkdir()
    (tmp_path / "fields.h5").mkdir()
    with pytest.raises(InputError, match=r"timeseries\.csv cannot be written .*--output"):
        Table(tmp_path / "timeseries.csv", ["a"])
    with pytest.raises(InputError, match=r"fields\.h5 cannot be written .*--output"):
        Fields(tmp_path, {}, small_heart)


def test_a_fields_file_that_another_program_holds_open_does_not_stop_a_run(
    fake, port, master, tmp_path: Path, small_heart: Mesh
) -> None:
    field = port("phi", shape=(small_heart.nodes,), location="node", record="nothing")
    units = {"a": fake("a", outputs=[field])}
    first = Fields(tmp_path, units, small_heart)
    with h5py.File(tmp_path / "fields.h5") as held:
        master(units, 2).run([first])
        first.close()
        # ParaView goes on showing what it had.
        assert len(held["frames_ms"]) == 0
    with h5py.File(tmp_path / "fields.h5") as file:
        assert len(file["frames_ms"]) == 3


def test_outputs_of_one_name_are_told_apart_by_their_unit(
    fake, port, master, tmp_path: Path, small_heart: Mesh
) -> None:
    ports = [port("x", unit="mm"), port("time", unit="ms")]
    field = port("phi", unit="mV", shape=(small_heart.nodes,), location="node", record="probes")
    units = {name: fake(name, outputs=[*ports[: 2 - (name == "b")], field], begins={"x": ord(name)}) for name in "ab"}
    series = TimeSeries(tmp_path, units, Probes(small_heart, {"base": [25.0, 0.0, -1.0]}))
    assert series.columns == [
        "time_ms",
        "a.phi_base_mV",
        "b.phi_base_mV",
        "a.x_mm",
        "a.time_ms",
        "b.x_mm",
    ]
    fields = Fields(tmp_path, units, small_heart)
    master(units, 1).run([series, fields])
    assert series.column("a.x_mm") == [97.0, 97.0]
    assert series.column("b.x_mm") == [98.0, 98.0]
    series.close()
    fields.close()
    with h5py.File(tmp_path / "fields.h5") as file:
        assert sorted(file["frames"]) == ["a.phi_mV", "b.phi_mV"]


# --- fields.h5 and fields.xdmf ------------------------------------------------------------------------------------


def test_the_fields_hold_mesh_fibres_and_a_frame_every_so_often(done: Outcome, small_heart: Mesh) -> None:
    nodes, elements = small_heart.nodes, small_heart.elements
    with h5py.File(done.folder / "fields.h5") as file:
        np.testing.assert_array_equal(file["points_mm"][:], small_heart.points)
        np.testing.assert_array_equal(file["cells"][:], small_heart.cells)
        assert file["frames_ms"][:].tolist() == [0.0, 3.0, 6.0]
        series = {
            "potential_mV": (nodes,),
            "activation_time_ms": (nodes,),
            "active_stress_kPa": (nodes,),
            "displacement_mm": (nodes, 3),
            "stretch": (elements,),
        }
        shapes: dict[str, tuple[int, ...]] = {}
        file.visititems(lambda name, item: shapes.update({name: item.shape} if isinstance(item, h5py.Dataset) else {}))
        assert shapes == {
            "points_mm": (nodes, 3),
            "cells": (elements, 4),
            **{f"boundaries/{name}": faces.shape for name, faces in small_heart.boundaries.items()},
            "fiber": (elements, 3),
            "sheet": (elements, 3),
            "frames_ms": (3,),
            **{f"views/{frame}/{name}": shape for frame in range(3) for name, shape in series.items()},
            **{f"frames/{name}": (3, *shape) for name, shape in series.items()},
        }
        for name in shapes:
            assert np.isfinite(file[name][:]).all(), name
        for name in series:
            for frame in range(3):
                np.testing.assert_array_equal(file[f"views/{frame}/{name}"][:], file[f"frames/{name}"][frame])
        np.testing.assert_allclose(np.linalg.norm(file["fiber"][:], axis=1), 1.0, atol=1e-12)
        assert (file["frames/displacement_mm"][0] == 0.0).all()
        assert (file["frames/displacement_mm"][2] != 0.0).any()


def _check_boundaries(folder: Path, mesh: Mesh) -> None:
    stored = StoredRun(folder).boundaries
    assert stored.keys() == mesh.boundaries.keys()
    for name, faces in mesh.boundaries.items():
        assert stored[name].dtype == np.int64
        # In their order and orientation, by which normals point out of the tissue.
        np.testing.assert_array_equal(stored[name], faces)


def test_the_boundaries_come_back_under_their_names(done: Outcome, small_heart: Mesh) -> None:
    assert len(small_heart.boundaries) == 5
    _check_boundaries(done.folder, small_heart)


def test_boundaries_may_have_any_name_and_are_there_while_the_run_goes_on(
    fake, port, master, tmp_path: Path, small_heart: Mesh
) -> None:
    faces = small_heart.boundary("base")
    names = ["base", "a/b", "a", "%2F", "/", ".", "..", "...", "Vorhof links, Öffnung", "a%2Fb", "a\0b"]
    mesh = Mesh(small_heart.points, small_heart.cells, {name: faces[: 2 + n] for n, name in enumerate(names)})
    field = port("phi", shape=(mesh.nodes,), location="node", record="nothing")
    units = {"a": fake("a", outputs=[field])}
    fields = Fields(tmp_path, units, mesh)
    _check_boundaries(tmp_path, mesh)

    class Reader:
        def accept(self, step: Accepted, exchange: Any) -> None:
            _check_boundaries(tmp_path, mesh)

    master(units, 4, every_ms=2.0).run([fields, Reader()])
    # What a resumed run begins with, and ends with.
    resumed = Fields(tmp_path, units, mesh, fields.memory())
    resumed.close()
    _check_boundaries(tmp_path, mesh)
    with h5py.File(tmp_path / "fields.h5") as file:
        assert len(file["frames_ms"]) == 3


def test_meshes_without_boundaries_and_runs_that_kept_none_have_none(tmp_path: Path, small_heart: Mesh) -> None:
    assert StoredRun(tmp_path).boundaries == {}
    Fields(tmp_path, {}, Mesh(small_heart.points, small_heart.cells)).close()
    assert StoredRun(tmp_path).boundaries == {}
    assert StoredRun(tmp_path).points_mm is not None


def _check_xdmf(folder: Path) -> list[float]:
    """Resolve every reference of fields.xdmf in its files; the times of its grids."""
    root = ElementTree.parse(folder / "fields.xdmf").getroot()
    grids = root.findall("./Domain/Grid/Grid")
    names = []
    for grid in grids:
        for item in grid.iter("DataItem"):
            if item.get("Format") != "HDF":
                continue
            name, path = str(item.text).strip().split(":")
            with h5py.File(folder / name) as file:
                data = file[path]
                dimensions = tuple(map(int, item.attrib["Dimensions"].split()))
                assert data.shape == dimensions, path
                assert data.dtype.kind == {"Float": "f", "Int": "i"}[item.attrib["NumberType"]]
                assert data.dtype.itemsize == int(item.attrib["Precision"])
        (topology,), (geometry,) = grid.findall("Topology"), grid.findall("Geometry")
        elements = int(topology.attrib["NumberOfElements"])
        nodes = int(geometry[0].attrib["Dimensions"].split()[0])
        for attribute in grid.findall("Attribute"):
            shape = list(map(int, attribute[0].attrib["Dimensions"].split()))
            assert shape[0] == {"Node": nodes, "Cell": elements}[attribute.attrib["Center"]]
            assert shape[1:] == {"Scalar": [], "Vector": [3]}[attribute.attrib["AttributeType"]]
        names.append([attribute.attrib["Name"] for attribute in grid.findall("Attribute")])
    assert all(sorted(each) == sorted(names[0]) for each in names)
    return [float(grid.find("Time").attrib["Value"]) for grid in grids]  # type: ignore[union-attr]


def test_every_reference_of_the_xdmf_exists_with_that_shape(done: Outcome) -> None:
    assert _check_xdmf(done.folder) == [0.0, 3.0, 6.0]


def test_paraviews_file_is_complete_while_the_run_goes_on(
    fake, port, master, tmp_path: Path, small_heart: Mesh
) -> None:
    field = port("phi", shape=(small_heart.nodes,), location="node", record="nothing")
    units = {"a": fake("a", outputs=[field], law=lambda given, before, time, size: {"phi": before["phi"] + 1.0})}
    fields = Fields(tmp_path, units, small_heart)
    seen = []

    class Reader:
        def accept(self, step: Accepted, exchange: Any) -> None:
            seen.append(_check_xdmf(tmp_path))

    master(units, 5, every_ms=2.0).run([fields, Reader()])
    fields.close()
    assert seen == [[0.0], [0.0], [0.0, 2.0], [0.0, 2.0], [0.0, 2.0, 4.0], [0.0, 2.0, 4.0]]
    with h5py.File(tmp_path / "fields.h5") as file:
        assert file["frames/phi"][:, 0].tolist() == [0.0, 2.0, 4.0]
    assert [path.name for path in tmp_path.iterdir() if path.suffix == ".part"] == []


# --- summary.json -------------------------------------------------------------------------------------------------


def test_the_summary_has_the_keys_of_the_contract(done: Outcome, small_heart_file: Path, tmp_path: Path) -> None:
    summary = _json(done.folder / "summary.json")
    assert summary == json.loads(json.dumps(done.summary))
    _, rows = _rows(done.folder / "timeseries.csv")
    assert (summary["status"], summary["steps"], summary["end_ms"]) == ("done", 7, 7.0)
    assert list(summary["activation_time_ms"]) == ["base", "apex"]
    assert 0.0 <= summary["activation_time_ms"]["base"] < 7.0
    assert summary["activation_time_ms"]["apex"] is None
    for number, column in ((3, "lv_volume_ml"), (4, "rv_volume_ml"), (5, "apex_uplift_mm")):
        expected = {"start": rows[0, number], "min": rows[:, number].min(), "end": rows[-1, number]}
        assert {key: summary[column][key] for key in expected} == expected
    start, least = rows[0, 3], rows[:, 3].min()
    assert summary["ejection_fraction"]["lv"] == pytest.approx((start - least) / start, rel=1e-12)
    wall = summary["wall_s"]
    assert set(wall) >= {"total", "master", "units"}
    assert set(wall["units"]) == {"fibers", "electrophysiology", "active_stress", "mechanics"}
    # What is left is the bookkeeping around the calls of the units.
    assert wall["total"] == pytest.approx(wall["master"] + sum(wall["units"].values()), rel=1e-2)
    assert summary["master_overhead"] == pytest.approx(wall["master"] / wall["total"])
    assert 0.0 < summary["master_overhead"] < 1.0
    cpu = summary["cpu_s"]
    assert set(cpu) == {"total", "units"}
    assert set(cpu["units"]) == set(wall["units"])
    assert min(cpu["units"].values()) > 0.0
    # Both are read off clocks of one kind; what the master itself computes is in the total alone.
    assert sum(cpu["units"].values()) < cpu["total"]
    assert summary["solves"] == {"fibers": 0, "electrophysiology": 7, "active_stress": 7, "mechanics": 7}
    assert summary["sweeps"] == 7
    assert {"python", "cardiac-cosim", "numpy", "fmpy"} <= set(summary["versions"])
    # The scenario as resolved, defaults written out, runs again as it is.
    (tmp_path / "again.yaml").write_text(json.dumps(summary["scenario"]))
    again, first = load_scenario(tmp_path / "again.yaml"), _scenario(small_heart_file)
    assert again.model_dump() == first.model_dump()
    assert summary["scenario"]["coupling"]["scheme"] == "gauss-seidel"


def test_outputs_named_like_keys_of_the_summary_do_not_replace_them(
    fake, port, master, tmp_path: Path, small_heart: Mesh, small_heart_file: Path
) -> None:
    outputs = [
        port("status"),
        port("end", unit="ms"),
        port("wall", unit="s"),
        port("sweeps"),
        port("empty_volume", unit="ml"),
    ]
    series = TimeSeries(tmp_path, {"a": fake("a", outputs=outputs)}, Probes(small_heart, {}))
    costs = {"wall_s": {"total": 2.0, "master": 1.0, "units": {}}, "cpu_s": {}, "solves": {}, "sweeps": 7}
    series.rows.append([0.0, 1.0, 2.0, 3.0, 4.0, 0.0])
    series.close()
    scenario = _scenario(small_heart_file)
    origin = Origin.of(scenario, tmp_path)
    summary = write_summary(tmp_path / "s.json", scenario, origin, series, costs, {"status": "done"})
    assert (summary["status"], summary["end_ms"], summary["wall_s"]) == ("done", 0.0, costs["wall_s"])
    assert summary["sweeps"] == 7
    # Nothing is ejected from a cavity without volume.
    assert summary["ejection_fraction"] == {}


@pytest.mark.parametrize(
    ("values", "crossing"),
    [
        ([-80.0, 20.0], 0.6),
        ([-80.0, -20.0, 0.0], 1.0),
        ([-80.0, -40.0, -20.0], 2.0),
        ([-80.0, -80.0, -40.0, 0.0], 2.5),
        ([-20.0, -80.0], 0.0),
        ([30.0, -80.0, 30.0], 0.0),
        ([-80.0, 30.0, -80.0, 30.0], 60.0 / 110.0),
        ([-80.0, -20.000001], None),
        ([-80.0], None),
        ([5.0], 0.0),
        ([], None),
    ],
)
def test_crossing_time(values: list[float], crossing: float | None) -> None:
    found = crossing_time([float(number) for number in range(len(values))], values, -20.0)
    assert found == (None if crossing is None else pytest.approx(crossing, rel=1e-12))


# --- runs that end early ------------------------------------------------------------------------------------------


def _failing(fake: Any, port: Any, mesh: Mesh, end: Exception) -> dict[str, Any]:
    def law(given: Any, before: Any, time: float, size: float) -> dict[str, Any]:
        if time > 0.0045:
            raise end
        return {"phi": before["phi"] + 1.0, "v": time}

    field = port("phi", unit="mV", shape=(mesh.nodes,), location="node", record="probes")
    return {"a": fake("a", outputs=[field, port("v", unit="ml")], law=law)}


@pytest.mark.parametrize("end", [ParticipantError("no equilibrium"), KeyboardInterrupt(), MemoryError()])
def test_however_a_run_ends_the_files_hold_all_good_steps(
    fake, port, master, tmp_path: Path, small_heart: Mesh, end: Exception
) -> None:
    units = _failing(fake, port, small_heart, end)
    series = TimeSeries(tmp_path, units, Probes(small_heart, _PROBES))
    fields = Fields(tmp_path, units, small_heart)
    log = CouplingLog(tmp_path, ["a"])
    with pytest.raises((RunError, KeyboardInterrupt, MemoryError)):
        master(units, 20, every_ms=2.0).run((series, fields, log))
    # As if the process ended here: the csv files are not closed.
    _, rows = _rows(tmp_path / "timeseries.csv")
    assert rows[:, 0].tolist() == [0, 1, 2, 3, 4, 5]
    np.testing.assert_allclose(rows[:, 1], [0, 1, 2, 3, 4, 5], rtol=1e-12)
    _, rows = _rows(tmp_path / "coupling.csv")
    assert rows[:, 0].tolist() == [1, 2, 3, 4, 5]
    assert _check_xdmf(tmp_path) == [0.0, 2.0, 4.0]
    fields.close()
    with h5py.File(tmp_path / "fields.h5") as file:
        assert file["frames_ms"][:].tolist() == [0.0, 2.0, 4.0]
        assert file["frames/phi_mV"][:, 0].tolist() == [0.0, 2.0, 4.0]


def test_a_field_that_cannot_be_fetched_leaves_no_half_a_frame(
    fake, port, master, tmp_path: Path, small_heart: Mesh
) -> None:
    class Mute(fake):  # type: ignore[misc, valid-type]
        def get(self, name: str) -> Any:
            if name == "late" and len(self.calls) > 4:
                raise ParticipantError("lost my voice")
            return super().get(name)

    ports = [port(name, shape=(small_heart.nodes,), location="node", record="nothing") for name in ("early", "late")]
    fields = Fields(tmp_path, units := {"a": Mute("a", outputs=ports)}, small_heart)
    with pytest.raises((RunError, ParticipantError)):
        master(units, 9).run([fields])
    fields.close()
    with h5py.File(tmp_path / "fields.h5") as file:
        lengths = {len(file["frames_ms"]), len(file["frames/early"]), len(file["frames/late"])}
    assert lengths == {3}
    assert _check_xdmf(tmp_path) == [0.0, 1.0, 2.0]


def test_a_failed_run_of_the_heart_says_so_in_its_summary(small_heart_file: Path, tmp_path: Path) -> None:
    units = {
        "electrophysiology": {"unit": "electrophysiology", "parameters": {"stimulus_depth_mm": 5.0}},
        "active_stress": {"unit": "active_stress", "parameters": {"delay_function": "as_printed"}},
        "fibers": {"unit": "fiber_generator"},
    }
    with pytest.raises(RunError, match="unit 'active_stress' failed in the step") as caught:
        run_scenario(_scenario(small_heart_file, units=units), Path(), tmp_path)
    summary = _json(tmp_path / "summary.json")
    assert (summary["status"], summary["message"]) == ("failed", str(caught.value))
    _, rows = _rows(tmp_path / "timeseries.csv")
    assert summary["steps"] == len(rows) - 1 == round(summary["end_ms"])
    assert len(rows) >= 2
    assert np.isfinite(rows).all()
    assert f"up to {summary['end_ms']:g} ms are complete" in summary["message"]
    assert len(_rows(tmp_path / "coupling.csv")[1]) == summary["steps"]
    _check_xdmf(tmp_path)


# --- iterations.csv and profile.json ------------------------------------------------------------------------------


def test_the_residual_history_is_that_of_the_log(small_heart_file: Path, tmp_path: Path, small_scenario: Path) -> None:
    iterate = "coupling.iterate={converge: {stretch: {relative: 1e-6}, potential: {relative: 1e-6}}}"
    scenario = load_scenario(small_scenario, ["coupling.step_ms=2.5", iterate])
    out = run_scenario(scenario, small_scenario.parent, tmp_path / "out").folder
    names, rows = _rows(out / "iterations.csv")
    columns = ["residual_mechanics.stretch", "residual_electrophysiology.potential"]
    assert names == ["time_ms", "iteration", *columns, "contraction_rate"]
    log = np.genfromtxt(out / "coupling.csv", delimiter=",", names=True)
    times, counts = np.unique(rows[:, 0], return_counts=True)
    assert times.tolist() == log["time_ms"].tolist()
    assert counts.tolist() == log["iterations"].tolist()
    last = rows[np.cumsum(counts) - 1]
    np.testing.assert_array_equal(last[:, 2], log["residual_mechanicsstretch"])
    # Each rate is that of the slowest field in this sweep.
    for before, row in itertools.pairwise(rows):
        if row[1] > 1:
            assert row[4] == max(row[2:4] / before[2:4])
        else:
            assert np.isnan(row[4])


def test_the_profile_is_in_the_trace_event_format_and_tells_who_was_busy(done: Outcome) -> None:
    events = json.loads((done.folder / "profile.json").read_text())
    rows = {event["tid"]: event["args"]["name"] for event in events if event["name"] == "thread_name"}
    assert list(rows.values()) == ["master", "fibers", "electrophysiology", "active_stress", "mechanics"]
    spans = [event for event in events if event["ph"] == "X"]
    for event in spans:
        assert {"name", "ts", "dur", "pid", "tid"} <= set(event)
        assert event["dur"] >= 0.0
    steps = [event for event in spans if rows[event["tid"]] == "mechanics" and event["name"] == "step"]
    assert len(steps) == done.summary["steps"]
    busy = sum(event["dur"] for event in spans if rows[event["tid"]] == "mechanics") * 1e-6
    assert busy == pytest.approx(done.summary["wall_s"]["units"]["mechanics"], rel=1e-6)
    # The master's steps hold those of the units.
    whole = [(event["ts"], event["ts"] + event["dur"]) for event in spans if rows[event["tid"]] == "master"]
    for event in steps:
        assert any(begin <= event["ts"] and event["ts"] + event["dur"] <= end + 1.0 for begin, end in whole)
