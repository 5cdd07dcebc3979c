"""The JSON schemas of study files, for editors: of charts and of stability maps.

The keys of a scenario that a study sets or varies are written with dots, `coupling.step_ms`: each has the schema that
it has in a scenario file. Which units the scenario has, and so which parameters, stands in another file; what is set in
`units` is therefore left to the study itself, which checks all of it before anything runs.
"""

from collections.abc import Iterator
from typing import Any

from ..orchestrator.participants.native import theory_names
from ..orchestrator.scenario_schema import DEFINITIONS, REFERENCE, Schema, model_schema, scenario_schema
from .study import Study

#: Keys of a study that a chart does not look at.
_OF_MAPS = ("bisect", "theory", "growth", "tolerances")

#: The section whose keys depend on the scenario, and a key in such a section.
_UNITS, _ANY = "units", "[^.]+"


def chart_schema() -> Schema:
    """The schema of a study for `cosim chart`."""
    schema = _study_schema("A study of cardiac-cosim for a chart of cost against accuracy")
    for key in _OF_MAPS:
        del schema["properties"][key]
    schema["required"].append("reference")
    return schema


def stability_schema() -> Schema:
    """The schema of a study for `cosim stability`."""
    schema = _study_schema("A study of cardiac-cosim for a map of stability")
    schema["properties"]["theory"]["anyOf"] = [{"enum": theory_names()}, {"type": "null"}]
    line = schema[DEFINITIONS]["Line"]
    line["properties"]["vary"] |= {"minProperties": 2, "maxProperties": 2}
    line["required"].append("vary")
    return schema


def _study_schema(title: str) -> Schema:
    schema, scenario = model_schema(Study, title), scenario_schema()
    definitions = schema[DEFINITIONS]
    keys = dict(_keys(scenario, scenario, "", ""))
    definitions["Settings"] = _section("Values of keys of the scenario", keys)
    definitions["Variations"] = _section(
        "Lists of values of keys of the scenario",
        {key: {"type": "array", "minItems": 1, "items": value} for key, value in keys.items()},
    )
    definitions["Reference"] = {
        "title": "Reference",
        "description": "The settings of a finer run, or the folder of one that is there, relative to the study file.",
        "anyOf": [
            {"allOf": [_to("Settings")], "minProperties": 1},
            {
                "type": "object",
                "properties": {
                    "results": {
                        "title": "Results",
                        "description": "The path of the results folder of a run, relative to the study file.",
                        "type": "string",
                    }
                },
                "required": ["results"],
                "additionalProperties": False,
            },
        ],
    }
    definitions |= scenario[DEFINITIONS]
    definitions["Scenario"] = {key: scenario[key] for key in ("type", "properties")}
    study, line = schema["properties"], definitions["Line"]["properties"]
    for section, key, name in ((study, "set", "Settings"), (line, "set", "Settings"), (line, "vary", "Variations")):
        told = {about: section[key][about] for about in ("title", "description")}
        section[key] = told | {"allOf": [_to(name)]}
    several = {"type": "array", "minItems": 1, "maxItems": 2, "items": _to("Reference")}
    study["reference"]["anyOf"] = [_to("Reference"), several]
    return schema


def _section(title: str, keys: dict[str, Schema]) -> Schema:
    patterns = {f"^{key}$".replace(".", r"\."): value for key, value in keys.items() if _ANY in key}
    patterns = {key.replace(r"[^\.]", "[^.]"): value for key, value in patterns.items()}
    return {
        "title": title,
        "type": "object",
        "properties": {key: value for key, value in keys.items() if _ANY not in key},
        "patternProperties": patterns,
        "additionalProperties": False,
    }


def _keys(schema: Schema, whole: Schema, key: str, place: str) -> Iterator[tuple[str, Schema]]:
    """Every key of a scenario below `key`, whose schema is at `place`, written with dots, with its schema."""
    for name, entry in schema.get("properties", {}).items():
        own = f"{key}.{name}" if key else name
        yield own, {"$ref": f"{place or REFERENCE.format(model='Scenario')}/properties/{name}"}
        if own == _UNITS:
            # Of a unit's entry, and of a parameter.
            yield f"{own}.{_ANY}", {}
            yield f"{own}.{_ANY}.(unit|fmu|every|parameters|start)", {}
            yield f"{own}.{_ANY}.(parameters|start).{_ANY}", {}
            continue
        for section, name_of_section in _sections(entry, whole):
            yield from _keys(section, whole, own, REFERENCE.format(model=name_of_section))
        inner = entry.get("additionalProperties") or next(iter(entry.get("patternProperties", {}).values()), None)
        if inner:
            yield f"{own}.{_ANY}", inner
            for section, name_of_section in _sections(inner, whole):
                yield from _keys(section, whole, f"{own}.{_ANY}", REFERENCE.format(model=name_of_section))


def _sections(entry: Schema, whole: Schema) -> Iterator[tuple[Schema, str]]:
    """The sections that a key may hold, with their names."""
    for form in (entry, *entry.get("anyOf", ()), *entry.get("allOf", ())):
        if "$ref" in form:
            name = form["$ref"].rpartition("/")[2]
            yield whole[DEFINITIONS][name], name


def _to(name: str) -> dict[str, Any]:
    return {"$ref": REFERENCE.format(model=name)}
