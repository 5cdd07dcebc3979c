"""If these fail, a person takes a setting for safe that is not, or cannot tell from a map where it is safe."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from math import log, sqrt
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from cardiac_cosim.studies.stability.axis_words import axis_words, pair_words
from cardiac_cosim.studies.stability.caption import sentences
from cardiac_cosim.studies.stability.figure import draw, write_figures
from cardiac_cosim.studies.stability.look import LOOKS, grey
from cardiac_cosim.studies.stability.map import (
    DIVERGED,
    KINDS,
    NOT_RUN,
    OSCILLATING,
    SOUND,
    Cell,
    Crossing,
    Panel,
    StabilityMap,
)
from cardiac_cosim.studies.stability.placed_axis import placed_axis
from cardiac_cosim.studies.stability.placed_panel import placed_panel
from maps import ALL, GAIN, STEP, all_kinds, four_panels, loop_gain, map_of, oscillator, panel_of, schemes
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import same_color, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text


def _panels(figure: Figure) -> list[Axes]:
    return [axis for axis in figure.axes if axis.axison]


def _key(figure: Figure) -> str:
    """The words of the legend, whose axes are the second without a frame."""
    return " ".join(text.get_text() for text in [axis for axis in figure.axes if not axis.axison][1].texts)


def _words(figure: Figure) -> str:
    """All text, without the ends of lines."""
    return " ".join(text.get_text().replace("\n", " ") for text in figure.findobj(Text))


def _boxes(axis: Axes) -> list[Rectangle]:
    return [each for each in axis.patches if isinstance(each, Rectangle) and each.get_label() in KINDS]


def _box_at(axis: Axes, x: float, y: float) -> Rectangle:
    (found,) = [
        box
        for box in _boxes(axis)
        if box.get_x() < x < box.get_x() + box.get_width() and box.get_y() < y < box.get_y() + box.get_height()
    ]
    return found


def _lines(axis: Axes, label: str) -> list[Line2D]:
    return [line for line in axis.lines if line.get_label() == label]


def _assert_nothing_collides(figure: Figure) -> None:
    """No words are beyond the sheet, on a panel or on other words."""
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    width, height = figure.canvas.get_width_height()
    windows = [axis.get_window_extent(renderer) for axis in _panels(figure)]
    boxes = []
    for text in figure.findobj(Text):
        if text.get_text() and text.get_visible():
            box = text.get_window_extent(renderer)
            assert min(box.x0, box.y0, width - box.x1, height - box.y1) >= 0.0, text.get_text()
            box = box.shrunk(0.95, 0.7)
            assert not any(box.overlaps(window) for window in windows), text.get_text()
            boxes.append((box, text.get_text()))
    for (box, one), (other_box, other) in combinations(boxes, 2):
        assert not box.overlaps(other_box), (one, other)


def _number_panel(xs: Sequence[Any], ys: Sequence[Any], **other: Any) -> Panel:
    return panel_of(xs, ys, lambda *_: SOUND, **other)


def test_classes_are_told_apart_by_colour_by_grey_and_by_hatching() -> None:
    assert set(LOOKS) == set(KINDS)
    for one, other in combinations(LOOKS.values(), 2):
        assert max(abs(a - b) for a, b in zip(to_rgb(one.color), to_rgb(other.color), strict=True)) > 0.1
        assert abs(grey(one.color) - grey(other.color)) > 0.08
        assert one.hatch[:1] != other.hatch[:1]
        assert one.pattern != other.pattern
        assert one.tile != other.tile
    # What is sound is calm, what fails is strong; hatching is seen on its own ground.
    assert LOOKS[SOUND].hatch == ""
    assert grey(LOOKS[SOUND].color) > max(
        grey(look.color) for kind, look in LOOKS.items() if kind not in (SOUND, NOT_RUN)
    )
    for kind, look in LOOKS.items():
        assert kind == SOUND or abs(grey(look.color) - grey(look.ink)) > 0.3


def test_every_class_is_drawn_as_its_legend_says_with_the_number_of_its_cells() -> None:
    figure = draw(all_kinds())
    (axis,) = _panels(figure)
    for number, kind in enumerate(KINDS):
        # The values of this axis are not in order: column 1 is that of the first class all the same.
        box = _box_at(axis, number + 1.0, 0.1)
        assert box.get_label() == kind
        assert same_color(box.get_facecolor(), LOOKS[kind].color)
        assert box.get_hatch() == LOOKS[kind].hatch
        assert f"{kind} (1)" in _key(figure)
    assert "sound (12)" in _key(draw(loop_gain()))
    assert "not converged" not in _key(draw(loop_gain()))


def test_a_box_stands_around_its_value_with_edges_midway() -> None:
    (axis,) = _panels(draw(loop_gain()))
    assert axis.get_xscale() == "linear"
    assert axis.get_yscale() == "log"
    box = _box_at(axis, 0.8, 1.0)
    assert box.get_x() == pytest.approx(0.65)
    assert box.get_x() + box.get_width() == pytest.approx(0.875)
    assert box.get_y() == pytest.approx(sqrt(0.5))
    assert box.get_y() + box.get_height() == pytest.approx(sqrt(2.0))
    assert _box_at(axis, 2.0, 10.0).get_label() == DIVERGED
    assert len(_boxes(axis)) == 36


@pytest.mark.parametrize(
    ("values", "is_logarithmic"),
    [
        ([0.1, 1.0, 10.0], True),
        ([1.0, 2.0, 5.0, 10.0, 20.0], True),
        ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0], False),
        ([1.0, 2.0, 4.0], False),
        ([0.0, 1.0, 10.0, 100.0], False),
        ([-1.0, 1.0, 100.0], False),
        ([100.0], False),
    ],
)
def test_an_axis_is_logarithmic_where_its_values_are(values: list[float], is_logarithmic: bool) -> None:
    axis = placed_axis(values)
    assert axis.is_logarithmic is is_logarithmic
    assert all(low < value < high for low, value, high in zip(axis.edges, axis.places, axis.edges[1:], strict=False))
    if min(values) > 0.0:
        assert axis.edges[0] >= 0.0


def test_values_that_are_no_numbers_have_equal_boxes_in_their_order() -> None:
    figure = draw(ALL["categories"]())
    (axis,) = _panels(figure)
    assert [label.get_text() for label in axis.get_xticklabels()] == ["jacobi", "gauss-seidel"]
    # Upwards the first stands above, as it is read.
    labels = [label.get_text().replace("\n", " ") for label in axis.get_yticklabels()]
    assert labels == ["{max_iterations: 20, acceleration: anderson}", "null"]
    assert _box_at(axis, 0.0, 1.0).get_label() == DIVERGED
    assert _box_at(axis, 1.0, 0.0).get_label() == SOUND
    assert {(box.get_width(), box.get_height()) for box in _boxes(axis)} == {(1.0, 1.0)}
    # True and 1 are two values.
    axis_of_both = placed_axis([True, 1])
    assert (axis_of_both.number(True), axis_of_both.number(1)) == (0, 1)


def test_the_predicted_boundary_is_where_theory_has_it_with_its_formula() -> None:
    figure = draw(oscillator())
    (axis,) = _panels(figure)
    (line,) = _lines(axis, "theory")
    assert list(zip(line.get_xdata(), line.get_ydata(), strict=True)) == oscillator().panels[0].limit[0]
    assert line.get_linewidth() > 2.0
    assert line.get_color() == "black"
    assert "theory: ρ(A(H)) < 1 with A the exact map" in _key(figure)
    # It is over the boxes and the runs between them.
    assert line.get_zorder() > max(box.get_zorder() for box in _boxes(axis))
    assert line.get_zorder() > max(each.get_zorder() for each in _lines(axis, "between"))


def test_a_boundary_that_is_not_on_the_map_is_not_in_the_legend() -> None:
    inside = [[(0.1, 1.5), (5.0, 1.5)]]
    beyond = [[(0.1, 9.0), (5.0, 9.0)]]
    for limit, is_seen in ((inside, True), (beyond, False), ([], False)):
        found = map_of([_number_panel([1.0, 2.0], [1.0, 2.0], limit=limit)])
        figure = draw(found)
        assert bool(_lines(_panels(figure)[0], "theory")) is is_seen
        assert ("theory:" in _key(figure)) is is_seen
        assert ("that boundary does not cross this map" in _words(figure)) is not is_seen
    # A straight line through the map whose corners are both outside.
    through = map_of([_number_panel([1.0, 2.0], [1.0, 2.0], limit=[[(-50.0, -50.0), (50.0, 50.0)]])])
    assert _lines(_panels(draw(through))[0], "theory")


def test_without_numbers_to_the_right_the_limit_of_each_value_is_drawn() -> None:
    (axis,) = _panels(draw(schemes()))
    heights = [tuple(line.get_ydata()) for line in _lines(axis, "theory")]
    assert heights == [(0.225, 0.225), (0.318, 0.318)]
    assert [tuple(line.get_xdata()) for line in _lines(axis, "theory")] == [(-0.5, 0.5), (1.5, 2.5)]


def test_measured_crossings_have_bars_between_the_two_runs() -> None:
    found = oscillator()
    figure = draw(found)
    (axis,) = _panels(figure)
    crossings = found.panels[0].crossings
    assert len(axis.containers) == len(crossings) == 6
    for crossing, drawn in zip(crossings, axis.containers, strict=True):
        ((begin, end),) = drawn.lines[2][0].get_segments()
        assert (begin[0], end[0]) == (crossing.x, crossing.x)
        assert (begin[1], end[1]) == pytest.approx((crossing.low, crossing.high))
        assert drawn.lines[0].get_ydata()[0] == crossing.measured
    assert "measured boundary" in _key(figure)
    assert "measured boundary" not in _key(draw(loop_gain()))


def test_runs_of_the_bisection_are_strips_that_leave_their_boxes_to_be_seen() -> None:
    found = oscillator()
    figure = draw(found)
    (axis,) = _panels(figure)
    cells = [cell for cell in found.cells if cell.bisected]
    strips = _lines(axis, "between")
    assert len(strips) == len(cells) == 36
    for cell, strip in zip(cells, strips, strict=True):
        assert set(strip.get_ydata()) == {cell.y}
        assert same_color(strip.get_color(), LOOKS[cell.kind].color)
        left, right = strip.get_xdata()
        assert left < cell.x < right
        box = next(box for box in _boxes(axis) if box.get_x() < cell.x < box.get_x() + box.get_width())
        share = log(right / left) / log((box.get_x() + box.get_width()) / box.get_x())
        assert 0.3 < share < 0.7
    assert len(_boxes(axis)) == 42
    assert "run of the bisection" in _key(figure)


def test_panels_stand_in_two_columns_under_one_legend() -> None:
    figure = draw(four_panels())
    panels = _panels(figure)
    places = [axis.get_position() for axis in panels]
    assert places[0].y0 == pytest.approx(places[1].y0)
    assert places[0].x0 == pytest.approx(places[2].x0)
    assert places[0].x1 < places[1].x0
    assert places[2].y1 < places[0].y0
    assert [axis.get_title(loc="left").split(",")[0] for axis in panels] == [
        "Jacobi",
        "Gauss–Seidel",
        "Gauss–Seidel",
        "iterated",
    ]
    assert _key(figure).count("sound (") == 1


@pytest.mark.parametrize("name", ALL)
def test_nothing_is_cut_off_at_the_sheet_or_covers_other_words(name: str) -> None:
    _assert_nothing_collides(draw(ALL[name]()))


def test_axes_say_the_last_part_of_their_key_and_the_caption_all_of_it() -> None:
    figure = draw(loop_gain())
    (axis,) = _panels(figure)
    assert (axis.get_xlabel(), axis.get_ylabel()) == ("length dependence", "step (ms)")
    assert f"x axis {GAIN}, y axis {STEP}" in _words(figure)
    for key, words in {
        "units.electrophysiology.parameters.longest_substep_ms": "longest substep (ms)",
        "units.x.parameters.slow_rate_per_ms": "slow rate (1/ms)",
        "units.x.parameters.diffusion_isotropic_mm2_per_ms": "diffusion isotropic (mm²/ms)",
        "units.x.parameters.tension_per_potential_MPa_per_mV": "tension per potential (MPa/mV)",
        "coupling.scheme": "scheme",
        "units.x.parameters.endocardial_angle_deg": "endocardial angle (°)",
        "k": "k",
        "ms": "ms",
    }.items():
        assert axis_words(key) == words
    # Two keys that end alike are told apart.
    assert pair_words("units.first.parameters.k", "units.second.parameters.k") == (
        "units.first.parameters.k",
        "units.second.parameters.k",
    )


def test_the_figure_says_what_theory_tolerances_references_and_machine_are() -> None:
    words = _words(draw(replace(four_panels(), scenario="somewhere/heart.yaml")))
    for part in (
        "four_schemes: where runs of heart.yaml are sound",
        "Theory (loop_gain): stable where |g| < 1, g = −K_a/K_p.",
        "Inaccurate: an error in lv_volume_ml of more than 0.5 ml or in activation_ms of more than 2 ms.",
        "the reference (the same with coupling.step_ms=0.1)",
        "AMD EPYC 7B13",
        "3 of 168 cells were not run.",
    ):
        assert part in words


def _sentences(found: StabilityMap) -> str:
    return " ".join(sentences(found, [placed_panel(panel) for panel in found.panels]))


def test_how_far_measurement_and_theory_are_apart_is_told() -> None:
    crossings = [Crossing(1.0, 1.0, 1.02, 1.0), Crossing(2.0, 1.9, 2.0, 2.0)]
    found = map_of([_number_panel([1.0, 2.0], [1.0, 2.0], crossings=crossings)])
    assert "At all of 2 places the measured boundary is within 2.5 % of the predicted one." in _sentences(found)
    without = [replace(crossing, predicted=None) for crossing in crossings]
    assert "within" not in _sentences(map_of([_number_panel([1.0, 2.0], [1.0, 2.0], crossings=without)]))


def test_panels_over_different_keys_say_which_are_theirs() -> None:
    one = _number_panel([1.0], [2.0], name="one")
    other = _number_panel([1.0], [2.0], name="other", x_key="coupling.order")
    text = _sentences(map_of([one, other]))
    assert f"one: x axis {GAIN}, y axis {STEP}" in text
    assert f"other: x axis coupling.order, y axis {STEP}" in text


def test_a_cell_that_is_nowhere_on_the_grid_is_not_passed_over() -> None:
    panel = _number_panel([1.0, 2.0], [1.0, 2.0])
    lost = replace(panel, cells=[*panel.cells, Cell(1.5, 1.0, OSCILLATING)])
    with pytest.raises(ValueError, match="not on the grid"):
        placed_panel(lost)
    nowhere = replace(panel, cells=[*panel.cells, Cell("jacobi", 1.0, OSCILLATING, bisected=True)])
    with pytest.raises(ValueError, match="no place"):
        placed_panel(nowhere)


_MANY = [0.1 * number for number in range(25)]

_ODD = {
    "one cell": map_of([_number_panel([1.0], [2.0])]),
    "one category": map_of([_number_panel(["a"], [None])]),
    "many": map_of([_number_panel(_MANY, _MANY)]),
    "many decades": map_of([_number_panel([10.0**n for n in range(-6, 7)], [10.0**n for n in range(-30, 31, 6)])]),
    "negative": map_of([_number_panel([-2.0, -1.0, 0.0], [-1e-7, 1e-7])]),
    "many categories": map_of([_number_panel([f"category {n}" for n in range(16)], [f"value {n}" for n in range(24)])]),
    "whole numbers": map_of([_number_panel([1, 2, 3], [10**15, 2 * 10**15])]),
    "three panels": map_of([_number_panel([1.0, 2.0], [3.0, 4.0], name=f"line {n}") for n in range(3)]),
    "holes": map_of([replace(_number_panel([1.0, 2.0], [3.0, 4.0]), cells=[Cell(1.0, 3.0, SOUND)])]),
    "no cells": map_of([replace(_number_panel([1.0, 2.0], [3.0, 4.0]), cells=[])]),
    "no machine": map_of([_number_panel([1.0], [2.0])], machine={}, versions={}, theory="", formula=""),
}


@pytest.mark.parametrize("name", _ODD)
@pytest.mark.filterwarnings("error")
def test_unusual_maps_are_drawn(name: str, tmp_path: Path) -> None:
    found = _ODD[name]
    png, svg = write_figures(found, tmp_path)
    assert imread(png).shape[1] == 1280
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    figure = draw(found)
    assert [len(_boxes(axis)) for axis in _panels(figure)] == [len(panel.cells) for panel in found.panels]
    _assert_nothing_collides(figure)


def test_the_same_map_gives_the_same_files(tmp_path: Path) -> None:
    first = [file.read_bytes() for file in write_figures(oscillator(), tmp_path)]
    assert first == [file.read_bytes() for file in write_figures(oscillator(), tmp_path)]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["stability.png", "stability.svg"]
    assert [file.name for file in write_figures(loop_gain(), tmp_path, "gain")] == ["gain.png", "gain.svg"]


@pytest.mark.filterwarnings("error")
def test_names_are_shown_letter_by_letter(tmp_path: Path) -> None:
    name = r"<b>&$_^ $\frac{1}{0}$ _x"
    panel = panel_of([name, "b"], [name, "c"], lambda *_: OSCILLATING, name, x_key=name, y_key=f"units.{name}")
    limited = _number_panel([1.0, 2.0], [1.0, 2.0], name=name, limit=[[(1.0, 1.0), (2.0, 2.0)]])
    found = map_of([panel, limited], name=name, formula=name, theory=name, references=[name], notes=[name])
    figure = draw(found)
    shown = [text.get_text() for text in figure.findobj(Text) if "frac" in text.get_text()]
    # Title, legend, panels, axes, labels and captions.
    assert len(shown) >= 8
    assert all(text.count("$") == text.count(r"\$") > 0 for text in shown)
    write_figures(found, tmp_path)
