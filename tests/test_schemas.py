"""If these fail, an editor marks a sound scenario as wrong, completes a key that there is not, or misses a mistake."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from cardiac_cosim.cli.schema_command import Kind, schema_text
from cardiac_cosim.orchestrator.participants.native import geometry_names, unit_names, unit_parameters
from cardiac_cosim.orchestrator.scenario import Scenario, file_content, load_scenario
from cardiac_cosim.orchestrator.scenario_schema import scenario_schema
from cardiac_cosim.studies.study import Study
from cardiac_cosim.studies.study_schema import chart_schema, stability_schema

_SCENARIOS = Path(__file__).parent.parent / "scenarios"
_SCHEMAS = {"scenario": scenario_schema(), "study": chart_schema(), "stability": stability_schema()}
_FOLDERS = {"scenario": ".", "study": "studies", "stability": "stability"}
_FILES = [(kind, path) for kind, folder in _FOLDERS.items() for path in sorted((_SCENARIOS / folder).glob("*.yaml"))]


def _content(path: Path) -> dict[str, Any]:
    return file_content(path, "file", "keys", Scenario)


def _problems(kind: str, content: dict[str, Any]) -> list[str]:
    return [error.json_path for error in jsonschema.Draft7Validator(_SCHEMAS[kind]).iter_errors(content)]


@pytest.mark.parametrize("kind", list(Kind))
def test_the_files_for_editors_are_those_that_the_command_prints(kind: Kind) -> None:
    path = _SCENARIOS / "schema" / f"{kind}.schema.json"
    assert path.read_text(encoding="utf-8") == f"{schema_text(kind)}\n", (
        f"out of date; run: cosim schema {kind} > scenarios/schema/{kind}.schema.json"
    )
    jsonschema.Draft7Validator.check_schema(_SCHEMAS[kind])


@pytest.mark.parametrize(("kind", "path"), _FILES, ids=[str(path.relative_to(_SCENARIOS)) for _, path in _FILES])
def test_every_file_that_comes_with_the_project_is_valid_and_names_its_schema(kind: str, path: Path) -> None:
    named = re.search(r"^# yaml-language-server: \$schema=(\S+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    assert named is not None
    assert (path.parent / named[1]).resolve() == _SCENARIOS / "schema" / f"{kind}.schema.json"
    assert _problems(kind, _content(path)) == []
    if kind == "scenario":
        # As summary.json has it, with all defaults written out.
        assert _problems(kind, load_scenario(path).resolved()) == []


_WRONG: dict[str, tuple[list[str], Any]] = {
    "unknown section": (["runn"], {"stop_ms": 3}),
    "unknown key": (["run", "stop"], 3),
    "number as a text": (["run", "stop_ms"], "10 ms"),
    "negative time": (["run", "stop_ms"], -1),
    "no time": (["coupling", "step_ms"], 0),
    "unknown scheme": (["coupling", "scheme"], "gauss_seidel"),
    "order beyond those there are": (["coupling", "extrapolation"], 3),
    "unknown geometry": (["scene", "geometry"], "biventricel"),
    "geometry and mesh": (["scene", "mesh"], "x.msh"),
    "unknown unit": (["units", "mechanics", "unit"], "mechanic"),
    "unit and FMU": (["units", "mechanics", "fmu"], "x.fmu"),
    "neither unit nor FMU": (["units", "mechanics"], {}),
    "name of a unit with a space": (["units", "my mechanics"], {"unit": "mechanics"}),
    "misspelt parameter": (["units", "mechanics", "parameters"], {"shear_modulus": 1}),
    "parameter of another unit": (["units", "fibers", "parameters"], {"shear_modulus_MPa": 1}),
    "parameter out of range": (["units", "mechanics", "parameters"], {"shear_modulus_MPa": -1}),
    "text for a parameter": (["units", "mechanics", "parameters"], {"shear_modulus_MPa": "stiff"}),
    "unknown choice": (["units", "mechanics", "parameters"], {"material": "holzapfel"}),
    "every step and a half": (["units", "mechanics", "every"], 1.5),
    "connection without an arrow": (["connections"], ["mechanics.stretch to active_stress.stretch"]),
    "connection without its end": (
        ["connections"],
        [{"from": "mechanics", "output": "stretch", "to": "fibers"}],
    ),
    "criterion without a limit": (["coupling", "iterate"], {"converge": {"stretch": {}}}),
    "iteration without a criterion": (["coupling", "iterate"], {"acceleration": "anderson"}),
    "probe of two coordinates": (["output", "probes_mm"], {"apex": [0, 0]}),
    "no name": (["name"], ""),
}


@pytest.mark.parametrize(("key", "value"), _WRONG.values(), ids=_WRONG)
def test_a_mistake_is_marked(key: list[str], value: Any) -> None:
    content = _content(_SCENARIOS / "baseline.yaml")
    section = content
    for name in key[:-1]:
        section = section.setdefault(name, {})
    section[key[-1]] = value
    assert _problems("scenario", content)


_WRONG_STUDIES: dict[str, tuple[str, str, Any]] = {
    "misspelt key of the scenario": ("study", "set", {"coupling.step": 1}),
    "value that no scenario has": ("study", "set", {"coupling.scheme": "jakobi"}),
    "one value where a list belongs": ("study", "lines", [{"name": "a", "vary": {"coupling.step_ms": 1}}]),
    "list of values that none has": ("study", "lines", [{"name": "a", "vary": {"coupling.step_ms": [0]}}]),
    "three references": ("study", "reference", [{"coupling.step_ms": size} for size in (0.1, 0.2, 0.3)]),
    "reference of no settings": ("study", "reference", {}),
    "theory of a map": ("study", "theory", "loop_gain"),
    "unknown theory": ("stability", "theory", "loop_gian"),
    "map of one axis": ("stability", "lines", [{"name": "a", "vary": {"coupling.step_ms": [1, 2]}}]),
    "map of three axes": (
        "stability",
        "lines",
        [{"name": "a", "vary": {"coupling.step_ms": [1], "run.stop_ms": [1], "scene.refine": [1]}}],
    ),
}


@pytest.mark.parametrize(("kind", "key", "value"), _WRONG_STUDIES.values(), ids=_WRONG_STUDIES)
def test_a_mistake_in_a_study_is_marked(kind: str, key: str, value: Any) -> None:
    path = {"study": "studies/strand.yaml", "stability": "stability/loop_gain.yaml"}[kind]
    assert _problems(kind, _content(_SCENARIOS / path) | {key: value})


def test_studies_may_set_whatever_scenarios_have() -> None:
    study = _content(_SCENARIOS / "studies" / "strand.yaml")
    for key, value in {
        "coupling.iterate.converge.stretch.relative": 1e-4,
        "coupling.iterate": None,
        "units.electrophysiology.parameters.refine": 2,
        "output.probes_mm.apex": [0, 0, -60],
        "scene.boundaries.base": "lid",
        "inputs.file": "x.csv",
    }.items():
        assert _problems("study", study | {"set": {key: value}}) == [], key
    assert _problems("study", study | {"reference": {"results": "../results/fine"}}) == []


def _entries(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for name, section in {"": schema, **schema["definitions"]}.items():
        if name not in ("Settings", "Variations"):
            for key, entry in section.get("properties", {}).items():
                yield f"{name}.{key}", entry


@pytest.mark.parametrize("kind", list(Kind))
def test_every_key_has_a_title_and_a_sentence_that_describes_it(kind: Kind) -> None:
    for key, entry in _entries(_SCHEMAS[kind]):
        assert entry["title"], key
        # Parameters have the few words of their unit's declaration, which may be one: 'mass'.
        is_parameter = key.startswith("parameters_of_")
        assert entry["description"] if is_parameter else entry["description"].endswith("."), key


def test_choices_and_parameters_are_those_that_there_are() -> None:
    definitions = scenario_schema()["definitions"]
    assert definitions["Scene"]["properties"]["geometry"]["anyOf"][0]["enum"] == geometry_names()
    for unit in unit_names():
        described = definitions[f"parameters_of_{unit}"]["properties"]
        assert {name: entry["default"] for name, entry in described.items()} == {
            parameter.name: parameter.default for parameter in unit_parameters(unit)
        }
        for parameter in unit_parameters(unit):
            if parameter.measure != "1" and not parameter.choices:
                assert described[parameter.name]["description"].endswith(f", in {parameter.measure}")
    assert set(chart_schema()["properties"]) < set(stability_schema()["properties"]) == set(Study.model_fields)
