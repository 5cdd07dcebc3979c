"""What is wrong with a scenario's content, as a sentence for a person: the key, what was written, and the remedy."""

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from pydantic import BaseModel

from ..errors import did_you_mean
from ..quoting import quoted, shortened
from .connection_section import AS_ENTRY, AS_TEXT
from .values import NAME, PROBE_NAME, UNIT_NAME, WORKERS

_ALLOWED = {
    WORKERS: "choose threads, processes, or the address of a Dask scheduler, tcp://host:port",
    NAME: "begin with a letter or digit, then letters, digits, '_', '-' and '.'",
    UNIT_NAME: "begin with a letter, then letters, digits and '_'",
    PROBE_NAME: "use letters, digits and '_'",
}


def explained(problem: Mapping[str, Any], model: type[BaseModel]) -> str:
    """The sentence for one of pydantic's errors about the content of `model`."""
    location = [shortened(str(part)) for part in problem["loc"] if part not in ("[key]", AS_TEXT, AS_ENTRY)]
    kind, given = problem["type"], problem["input"]
    key, is_key = ".".join(location), "[key]" in problem["loc"]
    context = problem.get("ctx", {})
    if kind == "extra_forbidden":
        return f"unknown key '{key}'{did_you_mean(location[-1], _keys_at(location[:-1], model))}"
    if kind == "missing":
        return f"the key '{key}' is missing"
    if kind == "value_error":
        return f"'{key}': {context['error']}" if key else str(context["error"])
    if kind == "invalid_key" or (is_key and kind == "string_type"):
        return (
            f"'{key}': a key has to be text, not {_short(given)}; put it in quotes "
            "(or, if it is the rest of a number, write that with a point: 0.5)"
        )
    if kind == "string_pattern_mismatch":
        what = "choice" if context["pattern"] == WORKERS else "name"
        return f"'{key}': {_short(given)} is not a valid {what}; {_ALLOWED[context['pattern']]}"
    if kind == "literal_error":
        return f"'{key}' is {_short(given)}: it should be {context['expected']}{_nearest(given, context['expected'])}"
    return f"'{key}' is {_short(given)}: {_expected(kind, given, problem)}"


def _expected(kind: str, given: Any, problem: Mapping[str, Any]) -> str:
    """What should be there instead of `given`, and what to do about it."""
    if kind in ("model_type", "dict_type", "model_attributes_type", "too_short") and not given:
        return "the section has no content; fill it or remove the key"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return "expected a section, lines `key: value` or {key: value, ...}"
    if problem["loc"][:2] == ("output", "probes_mm") and kind in ("list_type", "too_short", "too_long"):
        return "expected the three coordinates of a point in mm, [x, y, z]"
    if kind == "list_type":
        return "expected a list, lines `- item` or [item, item]"
    if kind == "string_type":
        return "expected a text" + ("" if given is None else "; put it in quotes")
    if kind in ("float_type", "int_type", "float_parsing"):
        unit = "; its unit of measure is the one the key's name ends in" if isinstance(given, str) else ""
        return f"expected a number, written alone and without quotes{unit}"
    if kind == "none_required":
        return "only null is supported so far; remove the key"
    message: str = problem["msg"]
    return message.replace("Input should be", "it should be")


def _nearest(given: Any, expected: str) -> str:
    names = [name.strip("' ") for name in expected.replace(" or ", ",").split(",")]
    hint = did_you_mean(str(given), names) if isinstance(given, str) else ""
    return hint if hint.startswith(";") and len(names) > 1 else ""


def _short(given: Any) -> str:
    return "empty" if given is None else quoted(given)


def _keys_at(location: Sequence[str], model: type[BaseModel]) -> list[str]:
    """The keys that the section at `location` of a `model` may have."""
    section: Any = model
    for part in location:
        fields = {field.alias or name: field.annotation for name, field in _section(section).model_fields.items()}
        # In a list of sections, or in one of sections by name, the part is which of them.
        section = fields.get(part, section)
    return [field.alias or name for name, field in _section(section).model_fields.items()]


def _section(annotation: Any) -> type[BaseModel]:
    """The section that a key of this annotation holds, however it is wrapped; the first of several."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    found = (_section(argument) for argument in get_args(annotation))
    return next((section for section in found if section is not BaseModel), BaseModel)
