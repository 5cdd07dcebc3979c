"""If these fail, a table says something else than the map, or cannot be read where something is not known."""

import csv
import json
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
from cardiac_cosim.studies.stability import Cell, Crossing, Panel, StabilityMap
from cardiac_cosim.studies.stability.counts import apart, summary
from cardiac_cosim.studies.stability.map import DIVERGED, INACCURATE, NOT_RUN, SOUND, UNIT_FAILED
from cardiac_cosim.studies.stability.map_tables import write_tables
from cardiac_cosim.studies.trial import DONE, FAILED, Cost, Trial

_ITERATE = {"acceleration": "anderson", "converge": {"stretch": {"relative": 1e-4}}}
_DONE = Trial(Path("points/abc"), DONE, "", (Cost(0.2, 0.1, {}),))
_FAILED = Trial(Path("points/def"), FAILED, "unit 'a' failed, \"here\"")

_CELLS = [
    Cell(None, 1, SOUND, "", 0.5, 0.4, {"lv_volume_ml": 0.1}, _DONE),
    Cell(None, 2.5, INACCURATE, "too far", None, inf, {"lv_volume_ml": inf}, _DONE, bisected=True),
    Cell(_ITERATE, 1, UNIT_FAILED, _FAILED.reason, None, None, {}, _FAILED),
    Cell(_ITERATE, 2.5, NOT_RUN, "cannot stand together"),
]
_PANEL = Panel(
    "held",
    "coupling.iterate",
    "coupling.step_ms",
    [None, _ITERATE],
    [1, 2.5],
    _CELLS,
    [Crossing(None, 1.0, 2.0, 1.2), Crossing(_ITERATE, 1.0, 2.0)],
    [[(1.0, 2.0), (1.5, 2.5)]],
)
_MAP = StabilityMap("m", "s.yaml", [_PANEL], "t", "|g| < 1", {"lv_volume_ml": 0.5}, ["r"], {"cores": 2}, {"numpy": "2"})


def test_the_table_has_a_row_for_every_cell_and_nothing_where_nothing_is_known(tmp_path: Path) -> None:
    write_tables(_MAP, tmp_path)
    with (tmp_path / "stability.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    told = "{acceleration: anderson, converge: {stretch: {relative: 0.0001}}}"
    assert [(row["x"], row["y"]) for row in rows] == [("null", "1"), ("null", "2.5"), (told, "1"), (told, "2.5")]
    assert [row["class"] for row in rows] == [SOUND, INACCURATE, UNIT_FAILED, NOT_RUN]
    assert [row["reason"] for row in rows] == [cell.reason for cell in _CELLS]
    assert [row["measure"] for row in rows] == ["0.5", "", "", ""]
    assert [row["predicted"] for row in rows] == ["0.4", "inf", "", ""]
    assert [row["bisected"] for row in rows] == ["0", "1", "0", "0"]
    assert [(row["wall_s"], row["cpu_s"]) for row in rows] == [("0.2", "0.1"), ("0.2", "0.1"), ("", ""), ("", "")]
    assert [row["error_lv_volume_ml"] for row in rows] == ["0.1", "inf", "", ""]
    assert [row["folder"] for row in rows] == ["abc", "abc", "def", ""]


def test_what_the_table_comes_from_can_be_read_by_any_program(tmp_path: Path) -> None:
    write_tables(_MAP, tmp_path, "other")
    told = json.loads((tmp_path / "other.json").read_text())
    assert told["counts"] == {SOUND: 1, INACCURATE: 1, UNIT_FAILED: 1, NOT_RUN: 1}
    held = told["lines"]["held"]
    assert (held["x"], held["y"]) == ("coupling.iterate", "coupling.step_ms")
    first, second = held["crossings"]
    assert (first["low"], first["high"], first["measured"], first["predicted"]) == (1.0, 2.0, 1.5, 1.2)
    assert first["difference"] == pytest.approx(0.25)
    assert (second["x"], second["predicted"], second["difference"]) == (_ITERATE, None, None)
    assert held["limit"] == [[[1.0, 2.0], [1.5, 2.5]]]
    assert (told["theory"], told["formula"], told["tolerances"]) == ("t", "|g| < 1", {"lv_volume_ml": 0.5})
    assert (told["references"], told["machine"], told["versions"]) == (["r"], {"cores": 2}, {"numpy": "2"})


def test_the_distance_is_relative_to_what_was_predicted() -> None:
    assert apart(Crossing(1, -1.2, -1.0, -1.0)) == pytest.approx(-0.1)
    assert apart(Crossing(1, 0.9, 1.1, 1.0)) == pytest.approx(0.0)
    assert apart(Crossing(1, -0.1, 0.1, 0.0)) is None


def test_a_terminal_gets_a_line_for_each_panel() -> None:
    grown = replace(_PANEL, name="other", cells=[Cell(1, 1, DIVERGED)], crossings=[])
    assert summary(replace(_MAP, panels=[_PANEL, grown])).splitlines() == [
        "held: 1 sound, 1 inaccurate, 1 unit failed, 1 not run; limit of coupling.step_ms at coupling.iterate = "
        "null: 1.5 ± 0.5 (predicted 1.2, +25.0%), "
        "{acceleration: anderson, converge: {stretch: {relative: 0.0001}}}: 1.5 ± 0.5",
        "other: 1 diverged",
    ]
