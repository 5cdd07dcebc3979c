"""If these fail, the page of a chart lacks points or reasons, runs what a name says, or needs a network."""

import json
import re
from dataclasses import replace
from html import escape
from html.parser import HTMLParser
from math import inf, isfinite
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.studies.chart.chart import Chart, Row
from cardiac_cosim.studies.chart.figure import draw
from cardiac_cosim.studies.chart.html_page import page, write_page
from cardiac_cosim.studies.chart.panel import views
from cardiac_cosim.studies.chart.plot import plot
from cardiac_cosim.studies.chart.style import style_of
from cardiac_cosim.studies.pictures.markup import safe
from synthetic_charts import CPU, MEASURES, chart_of, done, realistic, without_results

_ACTIVATION = MEASURES[0]
_STEP = "coupling.step_ms"
_EVIL = '</script><script>alert(1)</script><b>&$x_0^2$ "%{x}" <a href="https://example.org">'


def _content(chart: Chart) -> dict[str, Any]:
    """What Plotly is given."""
    return json.loads(plot(chart).to_json())


def _shown(content: dict[str, Any], view: int) -> list[dict[str, Any]]:
    """The traces that a button shows."""
    (menu,) = content["layout"]["updatemenus"]
    visible = menu["buttons"][view]["args"][0]["visible"]
    assert len(visible) == len(content["data"])
    return [trace for trace, is_visible in zip(content["data"], visible, strict=True) if is_visible]


def _points(traces: list[dict[str, Any]], line: int, axis: str | None = None) -> list[tuple[Any, Any, str, str]]:
    """Place, symbol and text of a line's points, in one panel or in all."""
    found = []
    for trace in traces:
        if trace.get("legendgroup") == f"line {line}" and axis in (None, trace["xaxis"]):
            symbols = trace["marker"]["symbol"]
            symbols = [symbols] * len(trace["x"]) if isinstance(symbols, str) else symbols
            places = zip(trace["x"], trace["y"], symbols, trace["hovertext"], strict=False)
            found += [place for place in places if place[0] is not None]
    return found


class _Tags(HTMLParser):
    """All tags of a page with their attributes, and the words of its table."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.cells: list[str] = []
        self._in_cell = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag == "td":
            self.cells.append("")

        self._in_cell = tag == "td"

    def handle_endtag(self, tag: str) -> None:
        self._in_cell = False

    def handle_data(self, data: str) -> None:
        if self._in_cell:
            self.cells[-1] += data


def _tags(text: str) -> _Tags:
    parser = _Tags()
    parser.feed(text)
    return parser


def test_every_point_is_in_both_views_with_all_that_is_known_of_it() -> None:
    chart = realistic()
    content = _content(chart)
    for number, view in enumerate(views(chart)):
        traces = _shown(content, number)
        for line_number, line in enumerate(chart.lines):
            for place, measure in enumerate(chart.measures):
                points = _points(traces, line_number, "x" if place == 0 else f"x{place + 1}")
                finished = [row for row in line.rows if row.is_done]
                assert len(points) == len(finished)
                for row in finished:
                    (text,) = [each[3] for each in points if f"{_STEP} = {row.settings[_STEP]:g}<br>" in each[3]]
                    (cost,) = [each[0] for each in points if each[3] == text]
                    assert cost == view.cost(row)
                    assert row.trial is not None
                    for part in (line.name, "status: done", "electrophysiology", f"sweeps: {row.trial.sweeps}"):
                        assert part in text
                    assert f"solves: {row.solves} (" in text
                    error = row.errors[measure.name]
                    assert (f"error: {error:.3g} ms" if isfinite(error) else "error: infinite") in text or place
                    if len(row.trial.costs) > 1:
                        assert "median of 3 runs" in text
            missing = [row for row in line.rows if not row.is_done]
            for row in missing:
                # Once above every panel.
                texts = [each[3] for each in _points(traces, line_number) if row.reason in each[3]]
                assert len(texts) == len(missing) * len(chart.measures) or line.name != "Jacobi, held"
                assert all(f"status: {row.status}" in text for text in texts)


def test_both_pictures_have_the_same_colours_fronts_and_limits() -> None:
    chart = realistic()
    content = _content(chart)
    axes = [axis for axis in draw(chart).axes if axis.get_xscale() == "log"]
    for number in range(2):
        traces = _shown(content, number)
        for place in range(len(chart.measures)):
            suffix = "" if place == 0 else str(place + 1)
            axis = axes[2 * place + number]
            (front,) = [each for each in axis.lines if each.get_label() == "front"]
            (drawn,) = [each for each in traces if each["name"] == "front" and each["xaxis"] == f"x{suffix}"]
            assert drawn["x"] == pytest.approx(list(front.get_xdata()))
            assert drawn["y"] == pytest.approx(list(front.get_ydata()))
            for line in range(len(chart.lines)):
                for *_, symbol, text in _points(traces, line, f"x{suffix}"):
                    if "infinite" not in text:
                        is_full = text.endswith("<br>on the front")
                        assert symbol == style_of(line).symbol + ("" if is_full else "-open")
    for line in range(len(chart.lines)):
        for trace in content["data"]:
            if trace.get("legendgroup") == f"line {line}":
                assert trace["marker"]["color"] == style_of(line).color


def test_a_button_changes_words_and_limits_of_every_axis() -> None:
    chart = replace(realistic(), cost=CPU)
    (menu,) = _content(chart)["layout"]["updatemenus"]
    seconds, solves = menu["buttons"]
    assert seconds["label"] == "seconds of CPU time"
    for suffix in ("", "2", "3"):
        assert seconds["args"][1][f"xaxis{suffix}.title.text"] == "seconds of CPU time"
        assert solves["args"][1][f"xaxis{suffix}.title.text"] == solves["label"]
        low, high = solves["args"][1][f"xaxis{suffix}.range"]
        costs = [row.solves for row in chart.rows if row.is_done]
        assert 10.0**low < min(costs) < max(costs) < 10.0**high


def test_orders_uncertainty_and_units_are_told() -> None:
    chart = realistic()
    content = _content(chart)
    for place, measure in enumerate(chart.measures):
        suffix = "" if place == 0 else str(place + 1)
        title = content["layout"][f"yaxis{suffix}"]["title"]["text"].replace("<br>", " ")
        assert title == f"{measure.description} ({measure.unit})"
        for number, line in enumerate(chart.lines):
            names = [
                trace["name"]
                for trace in _shown(content, 0)
                if trace.get("legendgroup") == f"line {number}"
                and trace["xaxis"] == f"x{suffix}"
                and trace.get("showlegend")
            ]
            assert len(names) == 1
            order = line.orders.get(measure.name)
            assert names[0].endswith(f"order {order:z.1f}") if order is not None else "order" not in names[0]
    shapes = content["layout"]["shapes"]
    assert [shape["y1"] for shape in shapes] == [0.3, 0.004]
    assert [shape["name"].split("<br>")[1] for shape in shapes] == ["0.3 ms", "0.004 ml"]


def test_the_table_has_every_point_and_reason() -> None:
    chart = realistic()
    parser = _tags(page(chart))
    assert sum(tag == "tr" for tag, _ in parser.tags) == len(chart.rows) + 1
    for row in chart.rows:
        assert row.reason in parser.cells
    for line in chart.lines:
        assert parser.cells.count(line.name) == len(line.rows)
    for measure in chart.measures:
        on = [f"{row.errors[measure.name]:.3g} {measure.unit}" for row in chart.rows if measure.name in row.front]
        assert on
        assert set(on) <= set(parser.cells)


def test_the_heading_says_where_the_numbers_are_from() -> None:
    text = page(realistic())
    for part in ("coupling_step", "baseline.yaml", "AMD EPYC 7B13", "numpy 2.3.1", "coupling.step_ms=0.2", "4 of 25"):
        assert part in text
    assert "each point ran alone on its core" in text


def test_the_page_loads_nothing_from_anywhere(tmp_path: Path) -> None:
    text = write_page(realistic(), tmp_path).read_text(encoding="utf-8")
    assert [file.name for file in tmp_path.iterdir()] == ["chart.html"]
    parser = _tags(text)
    for tag, attributes in parser.tags:
        assert tag not in ("link", "img", "iframe", "object", "embed", "base", "a")
        assert not {"src", "href", "srcset", "data", "action", "background"} & attributes.keys()
    assert not re.search(r"@import|url\(\s*['\"]?https?:", re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL))
    # Plotly's program has addresses in it: the browser is told to load nothing at all.
    (policy,) = [each["content"] for tag, each in parser.tags if each.get("http-equiv") == "Content-Security-Policy"]
    assert policy is not None
    assert policy.startswith("default-src 'none';")
    assert not re.search(r"https?:|\*", policy)
    # What is ours has none.
    assert "http" not in plot(realistic()).to_json()


def test_names_and_reasons_are_shown_and_not_run() -> None:
    rows = [done({_STEP: 1.0}, {_ACTIVATION.name: 0.1}), without_results({_STEP: _EVIL}, "failed", _EVIL)]
    measure = replace(_ACTIVATION, description=_EVIL)
    other = {"name": _EVIL, "scenario": _EVIL, "references": [_EVIL], "notes": [_EVIL]}
    chart = chart_of({_EVIL: rows}, [measure], machine={"processor": _EVIL}, versions={_EVIL: _EVIL}, **other)
    plain = chart_of({"held": [done({_STEP: 1.0}, {_ACTIVATION.name: 0.1}), rows[1]]}, [_ACTIVATION])
    text = page(chart)
    # No tag comes from a name.
    assert {tag for tag, _ in _tags(text).tags} == {tag for tag, _ in _tags(page(plain)).tags}
    assert text.count("<script") == page(plain).count("<script")
    assert _EVIL in _tags(text).cells
    # Plotly shows entities as letters, and knows a few tags, of which we use two.
    for trace in plot(chart).to_plotly_json()["data"]:
        for said in [trace["name"], *trace.get("hovertext", [])]:
            assert not re.search(r"<(?!br>|b>|/b>)", said)
    title = _content(chart)["layout"]["yaxis"]["title"]["text"].replace("<br>", " ")
    assert escape("<script>", quote=False) in title
    assert "<script" not in title


def test_text_of_any_length_and_kind_is_one_short_line() -> None:
    assert safe("a\nb\x00c<") == "a b c&lt;"
    assert len(safe("x" * 100_000)) < 1000


def _row(error: float, **other: Any) -> Row:
    return done({_STEP: 1.0}, {_ACTIVATION.name: error}, **other)


@pytest.mark.parametrize(
    "lines",
    [
        {"baseline": [done({}, {_ACTIVATION.name: 0.5})]},
        {"zero": [_row(0.0)], "infinite": [_row(inf)]},
        {"no cost": [_row(0.5, wall_s=0.0, solves=0)]},
        {"far apart": [_row(5e-324), _row(1.7e308)]},
        {"one of many": [_row(0.1), *(without_results({_STEP: n}, "crashed", "") for n in range(60))]},
        {"none": [without_results({_STEP: 1.0}, "failed", "why")], "some": [_row(0.1)]},
        {f"line {n}": [_row(0.1 + n)] for n in range(20)},
    ],
    ids=lambda lines: next(iter(lines)),
)
def test_unusual_charts_have_a_page(lines: dict[str, list[Row]]) -> None:
    chart = chart_of(lines, [_ACTIVATION])
    traces = _shown(_content(chart), 0)
    for number, (name, rows) in enumerate(lines.items()):
        assert len(_points(traces, number)) == len(rows)
        assert any(trace["name"].startswith(name) and trace.get("showlegend") for trace in traces)
    assert sum(tag == "tr" for tag, _ in _tags(page(chart)).tags) == len(chart.rows) + 1


def test_errors_at_an_edge_are_arrows_and_what_cannot_be_compared_a_cross() -> None:
    lines = {"zero": [_row(0.0)], "infinite": [_row(inf)], "known": [_row(0.1)], "other": [done({_STEP: 1.0}, {})]}
    content = _content(chart_of(lines, [_ACTIVATION]))
    low, high = (10.0**power for power in content["layout"]["yaxis"]["range"])
    traces = _shown(content, 0)
    expected = [(low, "arrow-down"), (high, "arrow-up"), (0.1, None), (high, "x-thin-open")]
    for number, (height, symbol) in enumerate(expected):
        ((_, y, found, _),) = _points(traces, number)
        assert y == pytest.approx(height)
        assert symbol in (None, found)
