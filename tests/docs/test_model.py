"""If these fail, the page on the model describes another one than the units compute."""

import re
from pathlib import Path

import pytest
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality

_ROOT = Path(__file__).parents[2]
_TEXT = (_ROOT / "docs" / "model.md").read_text(encoding="utf-8")


def _parameters(unit: str) -> dict[str, object]:
    """By name, what the unit takes where nothing is set."""
    return {item.name: item.start for item in UNITS[unit].variables() if item.causality is Causality.PARAMETER}


def test_parameters_have_the_values_of_the_page() -> None:
    tables = re.findall(r"\| symbol \| parameter of `(\w+)` \| value \|\n\|---\|---\|---\|\n((?:\|.*\n)+)", _TEXT)
    assert [unit for unit, _ in tables] == ["fiber_generator", "electrophysiology", "active_stress", "mechanics"]
    for unit, rows in tables:
        declared = _parameters(unit)
        for name, value in re.findall(r"\| `(\w+)` \| (\S+) \|\n", rows):
            assert declared[name] == pytest.approx(float(value), rel=1e-12), name
        assert rows.count("\n") == len(re.findall(r"\| `\w+` \| \S+ \|\n", rows))


def test_readings_as_printed_are_options_and_not_the_defaults() -> None:
    section = _TEXT.split("## 7.")[1].split("## 8.")[0]
    options = re.findall(r"`(\w+): (\w+)`", section)
    assert len(options) == 4
    for name, value in options:
        (found,) = [
            item
            for unit in ("electrophysiology", "active_stress", "mechanics")
            for item in UNITS[unit].variables()
            if item.name == name
        ]
        if found.choices:
            assert value in found.choices
        assert value != str(found.start)


def test_sections_that_the_code_cites_are_there() -> None:
    headings = re.findall(r"^## \d\. (.*)$", _TEXT, re.MULTILINE)
    cited = set()
    for folder in ("units", "fmus", "orchestrator", "tests"):
        for file in (_ROOT / folder).rglob("*.py"):
            cited |= set(re.findall(r"model\.md, ([A-Z][a-z]+(?:\s+[a-z]+)*)", file.read_text(encoding="utf-8")))
    assert len(cited) >= 5
    for section in cited:
        assert any(heading.startswith(" ".join(section.split())) for heading in headings), section


def test_tests_that_hold_its_numbers_are_there() -> None:
    named = re.findall(r"`(tests/[\w/]+\.py)`", _TEXT)
    assert len(set(named)) >= 7
    for file in named:
        assert (_ROOT / file).is_file(), file
