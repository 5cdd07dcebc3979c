"""If these fail, a person chooses a setting by a chart on which points, reasons or words are missing or elsewhere."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from cardiac_cosim.studies.chart.chart import Chart, Row
from cardiac_cosim.studies.chart.figure import draw, write_figures
from cardiac_cosim.studies.chart.panel import panel, path, views
from cardiac_cosim.studies.chart.style import style_of
from cardiac_cosim.studies.pictures.lettering import broken, plain, width_in
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from synthetic_charts import CPU, MEASURES, chart_of, done, realistic, without_results

_ACTIVATION = MEASURES[0]
_STEP = "coupling.step_ms"


def _sweep(errors: Mapping[float, float], **other: float) -> list[Row]:
    """A line over the step: the cost falls with it."""
    return [
        done({_STEP: step}, {_ACTIVATION.name: error}, 10.0 / step, int(100 / step), **other)
        for step, error in errors.items()
    ]


def _one(lines: Mapping[str, Sequence[Row]], **other: object) -> Chart:
    return chart_of(lines, [_ACTIVATION], **other)


def _panels(figure: Figure) -> list[Axes]:
    return [axis for axis in figure.axes if axis.get_xscale() == "log"]


def _words(figure: Figure) -> str:
    """All text, without the ends of lines."""
    return " ".join(text.get_text().replace("\n", " ") for text in figure.findobj(Text))


def _markers(axis: Axes, number: int, is_on_front: bool | None = None) -> list[Line2D]:
    """The markers of a line's points."""
    style = style_of(number)
    return [
        each
        for each in axis.lines
        if each.get_marker() == style.marker
        and same_color(each.get_markeredgecolor(), style.color)
        and (is_on_front is None or same_color(each.get_markerfacecolor(), style.color if is_on_front else "white"))
    ]


def _places(markers: Sequence[Line2D]) -> set[tuple[float, float]]:
    return {(float(each.get_xdata()[0]), float(each.get_ydata()[0])) for each in markers}


def _connections(axis: Axes, number: int) -> list[Line2D]:
    return [each for each in axis.lines if each.get_color() == style_of(number).color and len(each.get_xdata()) > 1]


def _band_top(axis: Axes) -> float:
    (band,) = [each for each in axis.patches if each.get_label() == "uncertainty of the reference"]
    return float(band.get_y() + band.get_height())


def test_every_point_of_every_line_is_in_both_views_of_every_measure() -> None:
    chart = realistic()
    axes = _panels(draw(chart))
    assert len(axes) == 2 * len(chart.measures)
    for place, axis in enumerate(axes):
        measure, view = chart.measures[place // 2], views(chart)[place % 2]
        for number, line in enumerate(chart.lines):
            assert len(_markers(axis, number)) == len(line.rows)
            expected = {(view.cost(row), row.errors[measure.name]) for row in line.rows if row.is_done}
            # An infinite error stands on the upper edge.
            expected = {(cost, min(error, axis.get_ylim()[1])) for cost, error in expected}
            assert expected <= _places(_markers(axis, number))


def test_names_and_orders_stand_beside_every_measure() -> None:
    chart = realistic()
    words = _words(draw(chart))
    for line in chart.lines:
        assert words.count(f"{line.name.split(',')[0]}") >= len(chart.measures)
    orders = [order for line in chart.lines for order in line.orders.values()]
    assert len(orders) > 10
    for order in orders:
        assert f"order {order:z.1f}" in words
    assert words.count("order ") >= len(orders)


def test_an_order_of_nearly_zero_has_no_sign() -> None:
    chart = _one({"flat": _sweep({1.0: 0.1, 2.0: 0.0999, 5.0: 0.0998})})
    assert -0.05 < chart.lines[0].orders[_ACTIVATION.name] < 0.0
    assert "order 0.0" in _words(draw(chart))


def test_the_axes_say_what_they_are_and_in_which_unit() -> None:
    chart = realistic()
    axes = _panels(draw(chart))
    for place, measure in enumerate(chart.measures):
        label = axes[2 * place].get_ylabel().replace("\n", " ")
        assert label == f"{measure.description} ({measure.unit})"
        assert axes[2 * place].get_xlabel() == "seconds of wall clock, alone on its core"
        assert axes[2 * place + 1].get_xlabel().startswith("solves")
        # The views of a measure are compared by eye.
        assert axes[2 * place].get_ylim() == axes[2 * place + 1].get_ylim()
    beside_others = _one({"held": _sweep({1.0: 0.1, 2.0: 0.2})}, cost=CPU)
    assert _panels(draw(beside_others))[0].get_xlabel() == "seconds of CPU time"


def test_points_on_the_front_are_full_and_others_hollow() -> None:
    # At each step the second line costs the same and errs by more.
    chart = _one({"good": _sweep({1.0: 0.1, 2.0: 0.2, 5.0: 0.5}), "bad": _sweep({1.0: 0.3, 2.0: 0.6, 5.0: 1.5})})
    for axis in _panels(draw(chart)):
        assert len(_markers(axis, 0, is_on_front=True)) == 3
        assert len(_markers(axis, 0, is_on_front=False)) == 0
        assert len(_markers(axis, 1, is_on_front=True)) == 0
        assert len(_markers(axis, 1, is_on_front=False)) == 3
        (front,) = [each for each in axis.lines if each.get_label() == "front"]
        # From the cheapest point down, only over what can be had for so much.
        np.testing.assert_allclose(front.get_ydata(), [0.5, 0.5, 0.2, 0.2, 0.1, 0.1])
        assert list(front.get_xdata()) == sorted(front.get_xdata())


def test_the_view_over_solves_has_a_front_of_its_own() -> None:
    quick = done({}, {_ACTIVATION.name: 0.2}, wall_s=1.0, solves=900)
    few = done({}, {_ACTIVATION.name: 0.2}, wall_s=2.0, solves=30)
    seconds, solves = _panels(draw(_one({"quick": [quick], "few": [few]})))
    assert [len(_markers(seconds, number, is_on_front=True)) for number in range(2)] == [1, 0]
    assert [len(_markers(solves, number, is_on_front=True)) for number in range(2)] == [0, 1]


def test_points_without_a_result_stand_outside_with_their_reasons_below() -> None:
    lines = {
        "held": [*_sweep({1.0: 0.1}), without_results({_STEP: 5.0}, "failed", "no equilibrium at 105 ms")],
        "ramped": [without_results({_STEP: step}, "refused", "must divide output.every_ms") for step in (3.0, 7.0)],
    }
    figure = draw(_one(lines))
    words = _words(figure)
    assert f"1: held ({_STEP}=5): failed: no equilibrium at 105 ms" in words
    assert f"2: ramped ({_STEP}=3, 7): refused: must divide output.every_ms" in words
    for axis in _panels(figure):
        crosses = [each for each in axis.lines if each.get_marker() == "x"]
        assert len(crosses) == 3
        # In parts of the axes: above them.
        assert all(each.get_ydata()[0] > 1.0 and each.get_transform() == axis.transAxes for each in crosses)
        outside = [text.get_text() for text in axis.texts if text.get_transform() == axis.transAxes]
        assert outside == ["no result:", "1", "2", "2"]


def test_many_reasons_leave_room_for_the_chart_and_say_where_the_others_are() -> None:
    failed = [without_results({_STEP: float(n)}, "failed", f"reason {n}") for n in range(2, 42)]
    figure = draw(_one({"held": [*_sweep({1.0: 0.1}), *failed]}))
    assert "25 more reasons are in the table and on the page of this chart." in _words(figure)
    for axis in _panels(figure):
        assert len([each for each in axis.lines if each.get_marker() == "x"]) == 40


def test_infinite_and_zero_errors_stand_at_the_edges() -> None:
    rows = _sweep({1.0: 0.1, 2.0: inf, 5.0: 0.0})
    rows[1] = replace(rows[1], reason="the probe apex is never activated")
    figure = draw(_one({"held": rows}))
    for axis in _panels(figure):
        low, high = axis.get_ylim()
        heights = sorted(place[1] for place in _places(_markers(axis, 0)))
        assert heights == [low, 0.1, high]
        texts = [text.get_text() for text in axis.texts]
        assert "↑ 1" in texts
        assert "↓ 0" in texts
        # What has no place is not connected.
        assert _connections(axis, 0) == []
    words = _words(figure)
    assert f"1: held ({_STEP}=2): infinite error: the probe apex is never activated" in words
    assert "error of exactly zero" in words


def test_a_point_that_cannot_be_compared_is_a_cross_at_its_cost() -> None:
    other_mesh = replace(done({_STEP: 2.0}, {}, wall_s=3.0), reason="another mesh")
    figure = draw(_one({"held": [*_sweep({1.0: 0.1}), other_mesh]}))
    assert f"1: held ({_STEP}=2): not comparable: another mesh" in _words(figure)
    seconds = _panels(figure)[0]
    (cross,) = [each for each in seconds.lines if each.get_marker() == "x"]
    assert (cross.get_xdata()[0], cross.get_ydata()[0]) == (3.0, seconds.get_ylim()[1])


def test_the_uncertainty_of_the_reference_is_shaded_and_told() -> None:
    chart = _one({"held": _sweep({1.0: 0.1, 2.0: 0.4})}, uncertainty={_ACTIVATION.name: 0.02})
    figure = draw(chart)
    for axis in _panels(figure):
        assert _band_top(axis) == pytest.approx(0.02)
        assert axis.get_ylim()[0] < 0.02
    assert "uncertainty of the reference: 0.02 ms" in _words(figure)
    # One that is far below all errors would squeeze them into a corner.
    far = draw(_one({"held": _sweep({1.0: 0.1, 2.0: 0.4})}, uncertainty={_ACTIVATION.name: 1e-9}))
    assert "1e-09 ms, below these axes" in _words(far)
    assert _panels(far)[0].get_ylim()[0] > 1e-3
    everything = draw(_one({"held": _sweep({1.0: 0.1})}, uncertainty={_ACTIVATION.name: inf}))
    assert _band_top(_panels(everything)[0]) == _panels(everything)[0].get_ylim()[1]


def test_repeated_runs_that_differ_have_a_bar_over_seconds_only() -> None:
    for spread, bars in ((0.2, [1, 0]), (0.01, [0, 0])):
        axes = _panels(draw(_one({"held": _sweep({1.0: 0.1}, spread=spread)})))
        assert [len(axis.containers) for axis in axes] == bars
    (bar,) = _panels(draw(_one({"held": _sweep({1.0: 0.1}, spread=0.2)})))[0].containers
    ((begin, end),) = bar.lines[2][0].get_segments()
    assert (begin[0], end[0]) == pytest.approx((8.0, 12.0))


def test_a_line_is_connected_in_the_order_of_its_number_and_broken_where_a_point_is_missing() -> None:
    rows = [*_sweep({5.0: 0.5, 1.0: 0.1, 2.0: 0.2, 10.0: 1.1, 20.0: 2.2})]
    rows[2] = without_results({_STEP: 2.0}, "failed", "no equilibrium")
    seconds = _panels(draw(_one({"held": rows})))[0]
    pieces = [list(each.get_ydata()) for each in _connections(seconds, 0)]
    assert pieces == [[0.5, 1.1, 2.2]]
    chart = _one({"held": rows})
    found = path(chart.lines[0], panel(chart, _ACTIVATION, views(chart)[0]).spots[0])
    assert [[spot.row.settings[_STEP] for spot in piece] for piece in found] == [[1.0], [5.0, 10.0, 20.0]]


def test_a_line_over_several_keys_is_connected_along_its_best_points() -> None:
    # Cost and error of a product: no order of the points means anything.
    grid = [(1.0, 0.9), (2.0, 1.5), (2.0, 0.4), (3.0, 0.6), (5.0, 0.1), (6.0, 0.3)]
    rows = [
        done({"a": number % 2, "b": number // 2}, {_ACTIVATION.name: error}, cost)
        for number, (cost, error) in enumerate(grid)
    ]
    figure = draw(_one({"grid": rows}))
    (best,) = _connections(_panels(figure)[0], 0)
    assert list(best.get_ydata()) == [0.9, 0.4, 0.1]
    assert len(_markers(_panels(figure)[0], 0)) == len(grid)
    assert "line through its best points" in _words(figure)


def test_points_are_labelled_with_what_varies_where_there_is_room() -> None:
    figure = draw(_one({"held": _sweep({0.5: 0.05, 1.0: 0.1, 2.0: 0.2, 5.0: 0.5})}))
    for axis in _panels(figure):
        assert sorted(text.get_text() for text in axis.texts) == ["0.5", "1", "2", "5"]
    assert f"at the points: {_STEP}" in _words(figure)
    # Points that lie on each other have no room for all their labels.
    crowd = _one({f"line {n}": _sweep({step: 0.1 * step for step in (1.0, 2.0, 5.0)}) for n in range(20)})
    axis = _panels(draw(crowd))[0]
    assert 0 < len(axis.texts) < 30


def test_labels_neither_cover_each_other_nor_a_marker() -> None:
    figure = draw(realistic())
    renderer = FigureCanvasAgg(figure).get_renderer()
    for axis in _panels(figure):
        labels = [text for text in axis.texts if text.get_text().replace(".", "").isdigit() and text.get_path_effects()]
        assert len(labels) > 10
        boxes = [label.get_window_extent(renderer) for label in labels]
        for number, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[number + 1 :])
        points = [axis.transData.transform(place) for line in range(5) for place in _places(_markers(axis, line))]
        assert not any(box.contains(*point) for box in boxes for point in points)


def test_nothing_is_cut_off_at_the_sheet_or_covers_other_words() -> None:
    for chart in (
        realistic(),
        _one({f"a line with a long name of its own, {n}": _sweep({1.0: 0.1}) for n in range(20)}),
    ):
        figure = draw(chart)
        renderer = FigureCanvasAgg(figure).get_renderer()
        figure.draw(renderer)
        width, height = figure.canvas.get_width_height()
        boxes = []
        for text in figure.findobj(Text):
            if text.get_text() and text.get_visible():
                box = text.get_window_extent(renderer)
                assert min(box.x0, box.y0, width - box.x1, height - box.y1) >= 0.0, text.get_text()
                if text.axes is not None and text.axes.get_xscale() == "linear":
                    boxes.append((box.shrunk(1.0, 0.7), text.get_text()))
        for number, (box, name) in enumerate(boxes):
            covered = [
                other for each, other in boxes[number + 1 :] if box.shrunk(1.0, 0.7).overlaps(each.shrunk(1.0, 0.7))
            ]
            assert not covered, (name, covered)


def test_the_figure_says_where_its_numbers_are_from() -> None:
    words = _words(draw(realistic()))
    for part in ("AMD EPYC 7B13", "coupling.step_ms=0.1", "coupling.step_ms=0.2", "baseline.yaml", "4 of 25 points"):
        assert part in words


def test_66_lines_differ_without_colour_and_neighbours_differ_in_all() -> None:
    styles = [style_of(number) for number in range(66)]
    assert len({(style.marker, style.dashes) for style in styles}) == 66
    for one, other in pairwise(styles):
        assert one.color != other.color
        assert one.marker != other.marker
        assert one.dashes != other.dashes


_ODD = {
    "one point": _one({"baseline": [done({}, {_ACTIVATION.name: 0.5})]}),
    "all zero": _one({"held": _sweep({1.0: 0.0, 2.0: 0.0})}),
    "all infinite": _one({"held": _sweep({1.0: inf, 2.0: inf})}),
    "no cost": _one({"held": [done({_STEP: 1.0}, {_ACTIVATION.name: 0.5}, wall_s=0.0, solves=0)]}),
    "far apart": _one({"held": _sweep({1.0: 5e-324, 2.0: 1.7e308, 5.0: 1.0})}),
    "one of many done": _one(
        {"held": [*_sweep({1.0: 0.1}), *(without_results({_STEP: n}, "crashed", "") for n in range(60))]}
    ),
    "thirteen measures": chart_of(
        {"held": [done({_STEP: 1.0}, {f"m{n}_ms": 0.1 * (n + 1) for n in range(13)})]},
        [replace(_ACTIVATION, name=f"m{n}_ms", description=f"measure {n}") for n in range(13)],
    ),
    "twenty lines": _one({f"line {n}": _sweep({1.0: 0.1 + n, 2.0: 0.3 + n}) for n in range(20)}),
}


@pytest.mark.parametrize("name", _ODD)
@pytest.mark.filterwarnings("error")
def test_unusual_charts_are_drawn(name: str, tmp_path: Path) -> None:
    chart = _ODD[name]
    png, svg = write_figures(chart, tmp_path)
    assert png.read_bytes().startswith(b"\x89PNG")
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    for axis in _panels(draw(chart)):
        assert sum(len(_markers(axis, number)) for number in range(len(chart.lines))) == len(chart.rows)


def test_the_same_chart_gives_the_same_files(tmp_path: Path) -> None:
    chart = _one({"held": _sweep({1.0: 0.1, 2.0: 0.2})})
    first = [file.read_bytes() for file in write_figures(chart, tmp_path)]
    assert first == [file.read_bytes() for file in write_figures(chart, tmp_path)]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["chart.png", "chart.svg"]


@pytest.mark.filterwarnings("error")
def test_names_are_shown_letter_by_letter(tmp_path: Path) -> None:
    name = r"<b>&$_^ $\frac{1}{0}$ _x"
    failed = without_results({_STEP: 2.0}, "failed", name)
    chart = _one(
        {name: [*_sweep({1.0: 0.1}), failed], "_hidden": _sweep({1.0: 0.3})}, name=name, machine={"processor": name}
    )
    figure = draw(chart)
    shown = [text.get_text() for text in figure.findobj(Text) if "frac" in text.get_text()]
    # Title, legend, footnote and caption.
    assert len(shown) >= 4
    assert all(text.count("$") == text.count(r"\$") > 0 for text in shown)
    assert any(plain(name) in text for text in shown)
    assert "_hidden" in _words(figure)
    write_figures(chart, tmp_path)


def test_lines_of_text_are_not_wider_than_asked() -> None:
    text = f"short words and {'x' * 300} and a $ sign"
    lines = broken(text, 9.0, 2.0)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    assert all(0.0 < width_in(line, 9.0) <= 2.0 for line in lines)
