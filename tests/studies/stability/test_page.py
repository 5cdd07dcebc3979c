"""If these fail, the page of a map lacks runs or reasons, runs what a name says, or needs a network."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from math import log10
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.studies.stability.look import LOOKS
from cardiac_cosim.studies.stability.map import DIVERGED, KINDS, OSCILLATING, SOUND, Crossing, Panel
from cardiac_cosim.studies.stability.page import page, write_page
from cardiac_cosim.studies.stability.placed_panel import placed_panel
from cardiac_cosim.studies.stability.plot import plot
from cardiac_cosim.studies.stability.telling import crossing_text, growth_text
from maps import ALL, GAIN, STEP, all_kinds, four_panels, loop_gain, map_of, oscillator, panel_of, schemes

_EVIL = '</script><script>alert(1)</script><b>&$x_0^2$ "%{x}" <a href="https://example.org">'


def _content(panel: Panel) -> dict[str, Any]:
    """What Plotly is given."""
    return json.loads(plot(placed_panel(panel)).to_json())


def _traces(content: dict[str, Any], name: str) -> list[dict[str, Any]]:
    return [trace for trace in content["data"] if trace["name"] == name]


def _hovered(content: dict[str, Any], x: float, y: float) -> str:
    """What stands at a place of the boxes."""
    (layer,) = _traces(content, "cells")
    (across,) = [n for n in range(len(layer["x"]) - 1) if layer["x"][n] < x < layer["x"][n + 1]]
    (up,) = [n for n in range(len(layer["y"]) - 1) if layer["y"][n] < y < layer["y"][n + 1]]
    return layer["hovertext"][up][across]


def _plain(text: str) -> str:
    """In one line; long words are broken at their joints."""
    return re.sub(r"(?<=[_.])<br>", "", text).replace("<br>", " ")


class _Tags(HTMLParser):
    """All tags of a page with their attributes, the words of its table, and those around it."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.cells: list[str] = []
        self.words = ""
        self._in: str = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "td":
            self.cells.append("")
        if tag in ("td", "li", "p", "h1", "h2", "script"):
            self._in = tag

    def handle_endtag(self, tag: str) -> None:
        if tag == self._in:
            self._in = ""

    def handle_data(self, data: str) -> None:
        if self._in == "td":
            self.cells[-1] += data
        elif self._in in ("li", "p", "h1"):
            self.words += data


def _tags(text: str) -> _Tags:
    parser = _Tags()
    parser.feed(text)
    return parser


def test_hovering_over_a_box_tells_all_of_its_run() -> None:
    found = loop_gain()
    (panel,) = found.panels
    content = _content(panel)
    for cell in panel.cells:
        text = _plain(_hovered(content, cell.x, cell.y))
        assert f"{GAIN} = {cell.x:g}" in text
        assert f"{STEP} = {cell.y:g}" in text
        assert f"<b>{cell.kind}</b>" in text
        assert cell.reason in text
        assert f"measured growth: {growth_text(cell.measure)}" in text
        assert f"predicted growth: {growth_text(cell.predicted)}" in text
        assert f"error in lv_volume_ml: {cell.errors['lv_volume_ml']:.3g} ml" in text
        assert cell.trial is not None
        assert f"wall clock: {cell.trial.wall_s:.3g} s" in text
    assert "error in activation_ms: infinite ms" in _plain(_hovered(content, 2.0, 1.0))


def test_boxes_have_the_colours_hatching_and_edges_of_the_figure() -> None:
    placed = placed_panel(all_kinds().panels[0])
    content = _content(placed.panel)
    for number, kind in enumerate(KINDS):
        (trace,) = _traces(content, kind)
        assert trace["fillcolor"] == LOOKS[kind].color
        assert trace["fillpattern"]["shape"] == LOOKS[kind].pattern
        assert trace["fillpattern"]["bgcolor"] == LOOKS[kind].color
        assert trace["fillpattern"]["fgcolor"] == LOOKS[kind].ink
        left, right, low, high = placed.corners((number, 0))
        assert trace["x"] == [left, right, right, left, left, None]
        assert trace["y"] == [low, low, high, high, low, None]
        assert f"<b>{kind}</b>" in _hovered(content, number + 1.0, 0.1)


def test_the_layer_that_is_hovered_over_is_not_seen_and_knows_where_nothing_was_run() -> None:
    panel = panel_of([1.0, 2.0], [1.0, 2.0], lambda *_: DIVERGED)
    content = _content(replace(panel, cells=panel.cells[:1]))
    (layer,) = _traces(content, "cells")
    assert layer["z"] == [[KINDS.index(DIVERGED), None], [None, None]]
    assert layer["hovertext"][1] == ["", ""]
    assert layer["hoverongaps"] is False
    assert all(color == "rgba(0,0,0,0)" for _, color in layer["colorscale"])


def test_boundaries_runs_between_and_axes_are_those_of_the_figure() -> None:
    (panel,) = oscillator().panels
    content = _content(panel)
    (theory,) = _traces(content, "theory")
    assert list(zip(theory["x"], theory["y"], strict=True)) == panel.limit[0]
    (measured,) = _traces(content, "measured")
    assert measured["x"] == [crossing.x for crossing in panel.crossings]
    for number, crossing in enumerate(panel.crossings):
        middle = measured["y"][number]
        assert middle + measured["error_y"]["array"][number] == pytest.approx(crossing.high)
        assert middle - measured["error_y"]["arrayminus"][number] == pytest.approx(crossing.low)
    for kind in (SOUND, OSCILLATING):
        (strips,) = _traces(content, f"bisection: {kind}")
        assert strips["y"] == [cell.y for cell in panel.cells if cell.bisected and cell.kind == kind]
        assert strips["marker"]["line"]["color"] == LOOKS[kind].color
        assert all("run of the bisection" in text for text in strips["hovertext"])
    for name, edges in (("xaxis", placed_panel(panel).x.edges), ("yaxis", placed_panel(panel).y.edges)):
        assert content["layout"][name]["type"] == "log"
        assert content["layout"][name]["range"] == pytest.approx([log10(edges[0]), log10(edges[-1])])
    assert content["layout"]["yaxis"]["title"]["text"] == "step (ms)"
    # What would be hovered over in place of the boxes says nothing.
    for trace in content["data"]:
        assert trace["hoverinfo"] == ("text" if "hovertext" in trace else "skip")


def test_values_that_are_no_numbers_stand_at_their_boxes() -> None:
    layout = _content(ALL["categories"]().panels[0])["layout"]
    assert layout["xaxis"]["tickvals"] == [0.0, 1.0]
    assert layout["xaxis"]["ticktext"] == ["jacobi", "gauss-seidel"]
    assert layout["yaxis"]["ticktext"][1] == "null"
    limits = [trace["y"][0] for trace in _traces(_content(schemes().panels[0]), "theory")]
    assert limits == [0.225, 0.318]


def test_numbers_that_are_close_to_each_other_do_not_stand_on_each_other() -> None:
    close = _content(panel_of([1.0, 1.01, 3.0], [1.0, 2.0], lambda *_: SOUND))["layout"]
    assert "ticktext" not in close["xaxis"]
    assert close["yaxis"]["ticktext"] == ["1", "2"]


def test_a_crossing_says_where_it_lies_and_how_far_from_theory() -> None:
    panel = panel_of([1.0], [1.0, 2.0], lambda *_: SOUND)
    text = _plain(crossing_text(panel, Crossing(1.0, 1.5, 1.52, 1.5)))
    assert f"{STEP} between 1.5 and 1.52" in text
    assert "predicted: 1.5" in text
    assert "difference: +0.67 %" in text
    assert "predicted" not in crossing_text(panel, Crossing(1.0, 1.5, 1.52))
    assert "difference" not in crossing_text(panel, Crossing(1.0, -0.1, 0.1, 0.0))


def test_growth_close_to_one_tells_on_which_side_it_is() -> None:
    assert growth_text(1.0 - 2e-6) == "0.999998"
    assert growth_text(1.0 + 4e-8) == "1.00000004"
    assert growth_text(1.31234) == "1.312"
    assert growth_text(None) == "–"


def test_the_legend_names_classes_with_their_numbers_and_the_formula() -> None:
    found = oscillator()
    words = _tags(page(found)).words
    for part in ("sound (41)", "oscillating (25)", "diverged (12)", "theory: ρ(A(H)) < 1 with A", "measured boundary"):
        assert part in words
    assert "not converged" not in words
    assert "run of the bisection" in words
    assert "run of the bisection" not in _tags(page(loop_gain())).words
    # A swatch is hatched as the boxes are.
    text = page(all_kinds())
    for kind, look in LOOKS.items():
        name = f"look-{kind.replace(' ', '-')}"
        assert f'fill="url(#{name})"' in text
        (pattern,) = re.findall(rf'<pattern id="{name}".*?</pattern>', text)
        assert look.color in pattern
        assert look.tile in pattern


def test_the_table_has_every_cell_and_reason() -> None:
    found = four_panels()
    parser = _tags(page(found))
    assert sum(tag == "tr" for tag, _ in parser.tags) == len(found.cells) + 1
    for panel in found.panels:
        assert parser.cells.count(panel.name) == len(panel.cells)
    for cell in found.cells:
        assert cell.reason in parser.cells
        assert cell.kind in parser.cells
    errors = _tags(page(loop_gain())).cells
    assert "0.6 ml" in errors
    assert "infinite ms" in errors
    # Where panels have other keys each value says its own.
    other = replace(found.panels[0], x_key=GAIN)
    assert f"{GAIN}=1" in _tags(page(replace(found, panels=[*found.panels, other]))).cells


def test_the_page_says_what_its_axes_are_in_words_and_where_its_numbers_are_from() -> None:
    words = _tags(page(loop_gain())).words
    for part in (
        "loop_gain: where runs of cell.yaml are sound",
        f"{GAIN}: length dependence",
        f"{STEP}: step (ms)",
        "an error in lv_volume_ml of more than 0.5 ml",
        "coupling.step_ms=0.1",
        "AMD EPYC 7B13",
        "numpy 2.3.1",
    ):
        assert part in words


def test_the_page_loads_nothing_from_anywhere(tmp_path: Path) -> None:
    text = write_page(four_panels(), tmp_path).read_text(encoding="utf-8")
    assert [file.name for file in tmp_path.iterdir()] == ["stability.html"]
    parser = _tags(text)
    for tag, attributes in parser.tags:
        assert tag not in ("link", "img", "iframe", "object", "embed", "base", "a")
        assert not {"src", "href", "xlink:href", "srcset", "data", "action", "background"} & attributes.keys()
    (policy,) = [each["content"] for tag, each in parser.tags if each.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert not re.search(r"https?:|\*", policy)
    without_scripts = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert not re.search(r"https?:", without_scripts)
    for panel in four_panels().panels:
        assert "http" not in plot(placed_panel(panel)).to_json()
    # Plotly's program is there once, and a figure for each panel.
    assert text.count("plotly.js v") == 1
    assert text.count("Plotly.newPlot(") == 4
    assert write_page(four_panels(), tmp_path, "other").name == "other.html"


def test_names_and_reasons_are_shown_and_not_run() -> None:
    panel = panel_of(
        [_EVIL, "b"], [_EVIL, {"c": _EVIL}], lambda *_: OSCILLATING, _EVIL, x_key=_EVIL, y_key=f"a.{_EVIL}"
    )
    cells = [replace(cell, reason=_EVIL, errors={_EVIL: 1.0}) for cell in panel.cells]
    other = {"name": _EVIL, "scenario": _EVIL, "theory": _EVIL, "formula": _EVIL, "references": [_EVIL]}
    other |= {"notes": [_EVIL], "tolerances": {_EVIL: 1.0}, "versions": {_EVIL: _EVIL}, "machine": {_EVIL: _EVIL}}
    evil = map_of([replace(panel, cells=cells)], **other)
    harmless = map_of([panel_of(["a", "b"], ["a", "c"], lambda *_: OSCILLATING)])
    text = page(evil)
    # No tag comes from a name.
    assert {tag for tag, _ in _tags(text).tags} == {tag for tag, _ in _tags(page(harmless)).tags}
    assert text.count("<script") == page(harmless).count("<script")
    assert _EVIL in _tags(text).cells
    content = _content(evil.panels[0])
    said = [text for trace in content["data"] for row in trace.get("hovertext", []) for text in row]
    said += [content["layout"][name]["title"]["text"] for name in ("xaxis", "yaxis")]
    said += [text for name in ("xaxis", "yaxis") for text in content["layout"][name]["ticktext"]]
    assert any("&lt;script&gt;" in _plain(text).replace(" ", "") for text in said)
    # Plotly shows entities as letters, and knows a few tags, of which we use two.
    for text in said:
        assert not re.search(r"<(?!br>|b>|/b>)", text)


@pytest.mark.parametrize("name", ALL)
def test_every_map_has_a_page_with_lines_for_a_telephone(name: str) -> None:
    found = ALL[name]()
    assert sum(tag == "tr" for tag, _ in _tags(page(found)).tags) == len(found.cells) + 1
    for panel in found.panels:
        for trace in _content(panel)["data"]:
            texts = trace.get("hovertext", [])
            for text in texts if trace["type"] == "scatter" else [text for row in texts for text in row]:
                assert all(len(re.sub(r"</?b>|&\w+;", " ", line)) <= 60 for line in text.split("<br>"))
