"""If these fail, a reader takes an indication for an estimate, or cannot tell which bar belongs to what."""

from math import nan
from pathlib import Path

import pytest
from cardiac_cosim.studies.budget import write_budget
from cardiac_cosim.studies.budget.bars import draw_budget
from cardiac_cosim.studies.budget.budget import Budget, Contribution, Quantity
from cardiac_cosim.studies.budget.sentences import measured, sentence
from cardiac_cosim.studies.budget.source import Source


def _contribution(source: str, estimate: float, trusted: bool, negligible: bool = False) -> Contribution:
    return Contribution(source, "activation_apex_ms", 107.23, estimate, 1.0, trusted, "why", "x=1", negligible)


def _quantity(*contributions: Contribution, name: str = "activation_apex_ms", value: float = 107.23) -> Quantity:
    return Quantity(name, value, contributions)


_APEX = _quantity(
    _contribution("communication step", -0.3, True),
    _contribution("mesh", 8.6, False),
    _contribution("tolerance", 1e-12, False, True),
    _contribution("gone", nan, False),
)
_SOURCES = [Source(name, "", "", {}, "") for name in ("communication step", "mesh", "tolerance", "gone")]


def test_bars_that_are_not_trusted_are_hollow_and_hatched() -> None:
    volume = _quantity(*_APEX.contributions, name="lv_volume_min_ml", value=20.0)
    figure = draw_budget(Budget("heart", _SOURCES, [_APEX, volume]))
    axes = figure.axes
    assert [axis.get_xlabel() for axis in axes] == ["error (ms)", "error (ml)"]
    assert axes[0].get_title() == "activation at apex\n107.2 ms ± 8.9"
    assert [label.get_text() for label in axes[0].get_yticklabels()] == [source.name for source in _SOURCES]
    bars = axes[0].patches
    assert [bar.get_width() for bar in bars] == [0.3, 8.6, 1e-12, 0.0]
    assert [bool(bar.get_hatch()) for bar in bars] == [False, True, True, True]
    assert bars[0].get_facecolor() != bars[1].get_facecolor() == (1.0, 1.0, 1.0, 1.0)
    assert [text.get_text() for text in axes[0].texts] == ["−0.3", "(+8.6)", "negligible", "unknown"]
    # The first source is on top, and all numbers have room.
    assert axes[0].yaxis_inverted()
    assert axes[0].get_xlim()[1] > 1.3 * 8.6
    labels = {text.get_text() for legend in figure.legends for text in legend.get_texts()}
    assert labels == {"estimate, trusted", "(not trusted): difference to the finest run"}


def test_a_budget_without_any_error_is_drawn_too(tmp_path: Path) -> None:
    still = _quantity(_contribution("communication step", 0.0, False, True))
    write_budget(Budget("still", _SOURCES[:1], [still]), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(before) == {"errors.csv", "errors.json", "errors.png", "errors.svg"}
    assert before["errors.png"].startswith(b"\x89PNG")
    write_budget(Budget("still", _SOURCES[:1], [still]), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_sentences_say_where_the_error_is_from_and_what_is_not_trusted() -> None:
    assert sentence(_APEX) == (
        "activation at apex: 107.2 ms ± 8.9, nearly all from the mesh; the communication step adds 0.3 "
        "(not trusted: mesh) (unknown: gone)"
    )
    alone = _quantity(_contribution("mesh", 0.014, True), name="lv_ejection_fraction", value=0.4251)
    assert sentence(alone) == "lv ejection fraction: 0.425 ± 0.014, all from the mesh"
    none = _quantity(_contribution("mesh", 0.0, False, True), name="apex_uplift_max_mm", value=3.0)
    assert sentence(none) == "largest apex uplift: 3 mm ± 0"


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (107.23, 9.04, "107.2 ms ± 9.0"),
        (107.23, 12.3, "107 ms ± 12"),
        (107.23, 0.0312, "107.230 ms ± 0.031"),
        (-1e-3, 4e-6, "-0.0010000 ms ± 0.0000040"),
        (0.0, 0.0, "0 ms ± 0"),
        (1234.5, 345.6, "1234 ms ± 346"),
    ],
)
def test_value_and_error_have_the_same_digits(value: float, error: float, text: str) -> None:
    assert measured(_quantity(_contribution("mesh", error, True), value=value)) == text
