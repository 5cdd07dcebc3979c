"""The JSON schema of scenario files, by which editors complete keys and mark mistakes while somebody types.

It derives from the model of a scenario, and from the geometries and units that there are with their parameters. What a
schema cannot say, that one number divides another or that a probe lies in the mesh, is found by `cosim show` and
`cosim run`. It is of draft 7, which all editors know.
"""

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel

from .participants.native import geometry_names, unit_names, unit_parameters, unit_summary
from .participants.unit_parameter import UnitParameter
from .scenario import Scenario

Schema = dict[str, Any]

#: Where the schemas of sections are, and how they are referred to.
DEFINITIONS = "definitions"
REFERENCE = f"#/{DEFINITIONS}/{{model}}"

#: Endings of keys that are the unit of measure of their value.
_MEASURES = ("ms", "mm", "s")


def scenario_schema() -> Schema:
    """The schema of a scenario file."""
    schema = model_schema(Scenario, "A scenario of cardiac-cosim")
    definitions = schema[DEFINITIONS]
    scene, unit = definitions["Scene"], definitions["UnitEntry"]
    scene["properties"]["geometry"] |= _one_of(geometry_names())
    scene["oneOf"] = [_given("geometry", "mesh"), _given("mesh", "geometry")]
    # What has a meaning with the other one only.
    scene["oneOf"][1]["properties"]["mesh_size_mm"] = False
    unit["properties"]["unit"] |= _one_of(unit_names())
    unit["oneOf"] = [_given("unit", "fmu"), _given("fmu", "unit")]
    unit["allOf"] = [
        {
            "if": {"properties": {"unit": {"const": name}}, "required": ["unit"]},
            "then": {"properties": {"parameters": {"$ref": REFERENCE.format(model=_parameters_of(name))}}},
        }
        for name in unit_names()
    ]
    definitions |= {_parameters_of(name): _parameters(name) for name in unit_names()}
    limit = ("absolute", "relative", "residual-relative")
    definitions["CriterionEntry"]["anyOf"] = [
        {"required": [each], "properties": {each: {"type": "number"}}} for each in limit
    ]
    for form in schema["properties"]["connections"]["items"]["oneOf"]:
        if form.get("type") == "string":
            form["pattern"] = "->"
    return schema


def model_schema(model: type[BaseModel], title: str) -> Schema:
    """The schema of `model`, with titles for its keys and a description for every key."""
    schema = model.model_json_schema(ref_template=REFERENCE)
    definitions = schema.pop("$defs")
    for section in (schema, *definitions.values()):
        # A description runs over lines in the source, which an editor would show.
        section["description"] = " ".join(section["description"].split())
        section["title"] = _words(section["title"])
        for key, entry in section["properties"].items():
            entry["title"] = _title(key)
            # Beside a reference draft 7 reads nothing.
            if "$ref" in entry:
                entry["allOf"] = [{"$ref": entry.pop("$ref")}]
            # Keys that a person chooses have to look like names.
            if "patternProperties" in entry:
                entry["additionalProperties"] = False
            # That a key may be left out goes without saying, and the defaults of a section are those of its keys.
            if entry.get("default") is None or isinstance(entry.get("default"), dict):
                entry.pop("default", None)
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "title": title}
    return head | {key: value for key, value in schema.items() if key != "title"} | {DEFINITIONS: definitions}


def _parameters(unit: str) -> Schema:
    return {
        "title": f"Parameters of {unit}",
        "description": unit_summary(unit),
        "type": "object",
        "properties": {parameter.name: _parameter(parameter) for parameter in unit_parameters(unit)},
        "additionalProperties": False,
    }


def _parameter(parameter: UnitParameter) -> Schema:
    measure = "" if parameter.measure == "1" or parameter.choices else f", in {parameter.measure}"
    about = {
        "title": parameter.name,
        "description": f"{parameter.description}{measure}",
        "default": parameter.default,
    }
    if parameter.choices:
        return about | {"enum": list(parameter.choices)}
    limits = {
        "exclusiveMinimum": parameter.above,
        "minimum": parameter.at_least,
        "exclusiveMaximum": parameter.below,
    }
    kind = "integer" if isinstance(parameter.default, int) else "number"
    return about | {"type": kind} | {key: limit for key, limit in limits.items() if limit is not None}


def _parameters_of(unit: str) -> str:
    return f"parameters of {unit}".replace(" ", "_")


def _one_of(names: list[str]) -> Mapping[str, Any]:
    return {"anyOf": [{"enum": names}, {"type": "null"}]}


def _given(key: str, other: str) -> Schema:
    """That `key` is given, and the other is not, or as null."""
    return {"required": [key], "properties": {key: {"type": "string"}, other: {"type": "null"}}}


def _title(key: str) -> str:
    """A key in words: `step_ms` is 'Step (ms)'."""
    words, _, ending = key.rpartition("_")
    if words and ending in _MEASURES:
        return f"{words.replace('_', ' ').capitalize()} ({ending})"
    return key.replace("_", " ").capitalize()


def _words(name: str) -> str:
    """The name of a class in words."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip().capitalize()
