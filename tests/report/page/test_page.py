"""If these fail, the page leaves out what a person has to know of a run, or is too large to pass on."""

import base64
import csv
import json
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.cli.app import main
from cardiac_cosim.orchestrator.results.comparison import headlines
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.run import show_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.report.page import prepared, write_page
from cardiac_cosim.report.page.coupling_curves import constants, coupling_curves
from cardiac_cosim.report.page.document import page
from cardiac_cosim.report.page.headline_table import headline_table
from cardiac_cosim.report.page.heart import heart
from cardiac_cosim.report.page.packed import Packed
from cardiac_cosim.report.page.panels import figure
from cardiac_cosim.report.page.run_curves import run_curves
from cardiac_cosim.units.mesh.file import read_mesh
from report_kinds import RunOf

_REFERENCE = Path(__file__).parents[2] / "data" / "reference_5mm.msh"

#: Of a report of the baseline.
_MOST_BYTES = 8_000_000


def test_a_page_of_the_baselines_size_is_small(tmp_path: Path) -> None:
    """Noise cannot be compressed: fields of a heartbeat take less."""
    mesh, frames, random = read_mesh(_REFERENCE), 65, np.random.default_rng(0)
    with h5py.File(tmp_path / "fields.h5", "w") as file:
        file["points_mm"], file["cells"], file["frames_ms"] = mesh.points, mesh.cells, 5.0 * np.arange(frames)
        file["fiber"] = random.normal(size=(mesh.elements, 3))
        nodes, elements = (frames, mesh.nodes), (frames, mesh.elements)
        for name, shape in (("potential_mV", nodes), ("active_stress_kPa", nodes), ("activation_time_ms", nodes)):
            file[f"frames/{name}"] = random.uniform(1.0, 100.0, shape)
        file["frames/stretch"] = random.uniform(0.8, 1.2, elements)
        file["frames/displacement_mm"] = random.normal(size=(*nodes, 3))
    path = write_page(tmp_path)
    assert path == tmp_path / "report.html"
    assert path.stat().st_size < _MOST_BYTES


def test_of_long_runs_fewer_frames_are_shown_and_the_page_says_so(
    run_of: RunOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = run_of("heart")
    views = prepared(run.folder)
    assert views is not None
    assert "Of the stored frames" not in page(run, views)
    numbers = 7 * len(views.shape.points) + len(views.shape.cells)
    # Not quite three frames of nine.
    monkeypatch.setattr("cardiac_cosim.report.page.heart._MOST_NUMBERS", 3 * numbers)
    shown = heart(run, views, Packed())
    assert shown is not None
    assert shown["times_ms"] == [0.0, 15.0, 30.0]
    assert shown["places"]["shape"][0] == shown["colorings"][0]["levels"]["shape"][0] == 3
    assert "Of the stored frames one in 3 is shown." in page(run, views)


def test_a_run_that_was_killed_is_shown_as_far_as_it_came(run_of: RunOf, tmp_path: Path) -> None:
    for name in ("timeseries.csv", "coupling.csv", "fields.h5"):
        shutil.copy(run_of("heart").folder / name, tmp_path)
    text = write_page(tmp_path).read_text(encoding="utf-8")
    assert "The run did not finish" in text
    assert "the results up to 40 ms" in text
    assert 'id="heart"' in text


def test_the_page_is_the_same_whether_it_was_prepared_or_not(run_of: RunOf) -> None:
    folder = run_of("heart").folder
    one = write_page(folder).read_bytes()
    assert write_page(folder, prepared(folder)).read_bytes() == one


def test_every_panel_names_its_unit_of_measure(run_of: RunOf) -> None:
    for kind, missing in (("heart", 0), ("strand", 0), ("cell", 0), ("oscillator", 3)):
        panels, _ = run_curves(run_of(kind))
        titles = [panel.title for panel in [*panels, *coupling_curves(run_of(kind))]]
        assert all("(" in title and title.endswith(")") for title in titles), titles
        assert sum("unit of measure not given" in title for title in titles) == missing
    titles = [panel.title for panel in run_curves(run_of("heart"))[0]]
    assert titles == [
        "transmembrane potential (mV)",
        "cavity volume (ml)",
        "apex uplift (mm)",
        "twist (°)",
        "strain (dimensionless)",
        "mean active stress (kPa)",
    ]


def test_what_never_changes_is_told_in_words(run_of: RunOf) -> None:
    panels, notes = run_curves(run_of("strand"))
    assert not any("volume" in panel.title for panel in panels)
    assert "lv_volume_ml = 0" in notes[0]
    assert constants(run_of("strand")) == [
        "Every communication step is 1 ms long.",
        "Every step takes one sweep.",
        "No attempt at a step was rejected.",
    ]
    adaptive = [panel.title for panel in coupling_curves(run_of("adaptive"))]
    assert "communication step size (ms)" in adaptive
    assert "estimated error over the tolerance (dimensionless)" in adaptive


def test_columns_of_new_quantities_are_shown_by_their_units(tmp_path: Path) -> None:
    columns = ["time_ms", "twist_deg", "radial_strain", "circumferential_strain"]
    rows = [[0, 0, 0, 0], [1, 3.5, 0.1, -0.05]]
    with (tmp_path / "timeseries.csv").open("w", newline="") as file:
        csv.writer(file).writerows([columns, *rows])
    panels, _ = run_curves(StoredRun(tmp_path))
    assert [panel.title for panel in panels] == ["twist (°)", "strain (dimensionless)"]
    assert [curve.name for curve in panels[1].curves] == ["radial", "circumferential"]


def test_headline_numbers_have_error_bars_where_an_error_budget_was_computed(run_of: RunOf, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    shutil.copytree(run_of("heart").folder, folder)
    name = "lv_volume_min_ml"
    value = headlines(StoredRun(folder))[name]
    assert all(not row.source for row in headline_table(StoredRun(folder)))
    head = "source,quantity,value,estimate,order,trusted,reason,finer"
    (folder / "errors.csv").write_text(
        f"{head}\nmesh,{name},{value},-0.4,2,1,,scene.refine=1\ncommunication step,{name},{value},0.1,1,1,,x\n"
    )
    (row,) = [row for row in headline_table(StoredRun(folder)) if "±" in row.value]
    assert row.name == "smallest lv volume"
    assert row.value == f"{value:.2f} ml ± 0.50"
    assert "mesh" in row.source
    assert row.value in write_page(folder).read_text(encoding="utf-8")
    # Of two sources of nearly the same size the words begin otherwise.
    (folder / "errors.csv").write_text(
        f"{head}\nmesh,{name},{value},-0.4,2,1,,scene.refine=1\ncommunication step,{name},{value},0.3,1,1,,x\n"
    )
    (row,) = [row for row in headline_table(StoredRun(folder)) if "±" in row.value]
    assert row.source == "the mesh contributes 0.4 and the communication step 0.3"


def test_what_is_not_modelled_is_kept_and_shown(small_scenario: Path, tmp_path: Path) -> None:
    told = []
    for participants in ("native", "fmu"):
        out = tmp_path / participants
        main_arguments = ["run", str(small_scenario), "--output", str(out), "--set", "run.stop_ms=1"]
        _cosim(*main_arguments, "--no-figures", "--no-report", "--participants", participants)
        told.append(json.loads((out / "summary.json").read_text(encoding="utf-8"))["not_modelled"])
    assert told[0] == told[1]
    assert "mechanics.lv_pressure: no unit gives it, so it keeps its start value" in told[0]
    shown = show_scenario(load_scenario(small_scenario, ()), small_scenario.parent)
    assert all(sentence in shown for sentence in told[0])
    written = write_page(tmp_path / "native").read_text(encoding="utf-8")
    assert all(f"<li>{sentence}</li>" in written for sentence in told[0])


def _cosim(*arguments: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["cosim", *arguments])
        try:
            main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def test_the_sweeps_of_a_step_that_failed_are_within_the_panel(tmp_path: Path) -> None:
    # They belong to a step beyond the last one that was accepted.
    (tmp_path / "timeseries.csv").write_text("time_ms,x\n0,1\n")
    (tmp_path / "iterations.csv").write_text("time_ms,iteration,residual_m.x,contraction_rate\n5,1,0.2,\n5,2,0.1,0.5\n")
    drawn = figure(coupling_curves(StoredRun(tmp_path)), 0.0)
    assert drawn is not None
    assert drawn["layout"]["xaxis"]["range"] == [0.0, 5.0]
    places = np.frombuffer(base64.b64decode(drawn["data"][0]["x"]["bdata"]))
    np.testing.assert_array_equal(places, [0.0, 2.5, 5.0])
