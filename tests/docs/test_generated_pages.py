"""If this failed, the reference would list keys, variables or commands that are not there, or miss some."""

import importlib
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario.model import Scenario
from cardiac_cosim.studies.study import Study
from cardiac_cosim.units.registry import UNITS
from doc_blocks import ROOT

_NAMES = ("command_reference", "decision_index", "fmu_variables", "scenario_keys", "study_keys", "unit_tables")


@pytest.fixture(params=_NAMES)
def generated(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs" / "generate")
    return importlib.import_module(request.param)


def test_pages_are_what_the_code_says(generated: ModuleType) -> None:
    assert generated.PAGE.read_text(encoding="utf-8") == generated.page(), "run `python docs/generate`"


def test_every_generator_is_tested_and_called() -> None:
    folder = ROOT / "docs" / "generate"
    with_page = {path.stem for path in folder.glob("*.py") if "\ndef page()" in path.read_text(encoding="utf-8")}
    assert with_page == set(_NAMES)
    assert all(f"import {name}\n" in (folder / "__main__.py").read_text(encoding="utf-8") for name in _NAMES)


@pytest.mark.parametrize(("model", "page"), [(Scenario, "scenario_keys"), (Study, "study_keys")])
def test_every_key_has_a_row(model: Any, page: str) -> None:
    # Found in another way than the page is written: every property anywhere in the schema.
    text = (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1].rpartition(".")[2] for line in text.splitlines() if line.startswith("| `")}
    assert set(_properties(model.model_json_schema())) == rows


def test_every_unit_has_its_tables() -> None:
    for page, title in (("units.md", "## `{}`"), ("reference/fmu_variables.md", "## The FMU of `{}`")):
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        for name, unit in UNITS.items():
            part = text.split(title.format(name) + "\n")[1].split("\n## ")[0]
            declared = [
                item.name
                for item in unit.variables()
                if page != "units.md" or item.causality.value != "calculatedParameter"
            ]
            assert all(f"| `{variable}` |" in part for variable in declared), name


def test_the_index_of_decisions_is_whole() -> None:
    folder = ROOT / "docs" / "decisions"
    text = (folder / "README.md").read_text(encoding="utf-8")
    numbers = [path.name[:4] for path in sorted(folder.glob("0*.md"))]
    assert len(numbers) == len(set(numbers)) == text.count("\n- ")


def _properties(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(schema.get("properties"), dict):
            yield from schema["properties"]
        for inner in schema.values():
            yield from _properties(inner)
    elif isinstance(schema, list):
        for inner in schema:
            yield from _properties(inner)
