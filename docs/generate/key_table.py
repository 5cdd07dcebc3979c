"""Tables of the keys of a YAML file, from the JSON schema of the model that checks it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Schema = dict[str, Any]

#: How the types of JSON are called in YAML files.
_TYPES = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "true or false",
    "object": "mapping",
}

#: How limits are written.
_LIMITS = {
    "exclusiveMinimum": "> {}",
    "minimum": "≥ {}",
    "exclusiveMaximum": "< {}",
    "maximum": "≤ {}",
    "minLength": "at least {} characters",
    "maxLength": "at most {} characters",
    "minItems": "at least {} values",
    "maxItems": "at most {} values",
    "minProperties": "at least {} entries",
    "maxProperties": "at most {} entries",
    "pattern": "`{}`",
}
#: Of these a lower limit of one says only that there has to be something.
_NOT_EMPTY = ("minLength", "minItems", "minProperties")


@dataclass(frozen=True)
class _Key:
    path: str
    schema: Schema
    required: bool


def key_tables(schema: Schema) -> str:
    """A table with a row for every key of `schema`: one for each of its sections, and one for all other keys."""
    groups: dict[str, list[_Key]] = {}
    for key in _keys(schema, schema, ""):
        first = key.path.split(".")[0].removesuffix("[]")
        inside = _is_section(schema["properties"][first], schema)
        groups.setdefault(first if inside else "", []).append(key)
    texts = []
    for name, keys in groups.items():
        head = f"## `{name}`" if name else "## Keys outside of the sections"
        about = _description(schema["properties"][name], schema) if name else ""
        table = ["| key | type | default | limits | meaning |", "|---|---|---|---|---|"]
        table += [_row(key, schema, about) for key in keys]
        texts.append("\n\n".join([head, *([about] if about else []), "\n".join(table)]))
    return "\n\n".join(texts) + "\n"


def _row(key: _Key, root: Schema, said: str) -> str:
    about = _description(key.schema, root)
    cells = (f"`{key.path}`", _type(key.schema, root), _default(key), _limits(key.schema, root))
    return "| " + " | ".join(_cell(text) for text in (*cells, "see above" if about and about == said else about)) + " |"


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def _keys(schema: Schema, root: Schema, prefix: str) -> Iterator[_Key]:
    """Every key below `schema`, outer ones first; `<name>` stands for a key that the writer of a file chooses."""
    for name, inner in schema.get("properties", {}).items():
        path = f"{prefix}{name}"
        yield _Key(path, inner, name in schema.get("required", ()))
        yield from _below(inner, root, path)


def _below(schema: Schema, root: Schema, path: str) -> Iterator[_Key]:
    for form in _forms(schema, root):
        if "properties" in form:
            yield from _keys(form, root, f"{path}.")
        elif isinstance(form.get("additionalProperties"), Mapping):
            yield from _below(form["additionalProperties"], root, f"{path}.<name>")
        elif isinstance(form.get("patternProperties"), Mapping):
            for inner in form["patternProperties"].values():
                yield from _below(inner, root, f"{path}.<name>")
        elif isinstance(form.get("items"), Mapping):
            yield from _below(form["items"], root, f"{path}[]")


def _forms(schema: Schema, root: Schema) -> list[Schema]:
    """The alternatives of a schema, but for null, with references followed."""
    if "$ref" in schema:
        inner: Any = root
        for step in schema["$ref"].removeprefix("#/").split("/"):
            inner = inner[step]
        return _forms(inner, root)
    alternatives = schema.get("anyOf") or schema.get("oneOf") or schema.get("allOf")
    if alternatives is None:
        kinds = schema.get("type")
        each_kind = [schema | {"type": kind} for kind in kinds] if isinstance(kinds, list) else [schema]
        return [form for form in each_kind if form.get("type") != "null"]
    return [form for each in alternatives for form in _forms(each, root)]


def _is_section(schema: Schema, root: Schema) -> bool:
    return any(True for _ in _below(schema, root, ""))


def _type(schema: Schema, root: Schema) -> str:
    return " or ".join(dict.fromkeys(_type_of(form, root) for form in _forms(schema, root))) or "any value"


def _type_of(form: Schema, root: Schema) -> str:
    if "enum" in form:
        return " or ".join(f"`{value}`" for value in form["enum"] if value is not None)
    if "const" in form:
        return f"`{form['const']}`"
    if form.get("type") == "array":
        return f"list of: {_type(form.get('items', {}), root)}"
    if isinstance(form.get("additionalProperties"), Mapping):
        return f"mapping of names to: {_type(form['additionalProperties'], root)}"
    return _TYPES.get(form.get("type", ""), "any value")


def _default(key: _Key) -> str:
    if key.required:
        return "required"
    default = key.schema.get("default")
    if default is None or default == {} or default == []:
        return "–"
    if isinstance(default, Mapping):
        return "as below"
    return f"`{str(default).lower() if isinstance(default, bool) else default}`"


def _limits(schema: Schema, root: Schema) -> str:
    found: list[str] = []
    for form in (schema, *_forms(schema, root)):
        for name, text in _LIMITS.items():
            if name in form:
                limit = form[name]
                shown = "not empty" if name in _NOT_EMPTY and limit == 1 else text.format(_number(limit))
                found.append(shown)
    return ", ".join(dict.fromkeys(found))


def _number(limit: Any) -> Any:
    return (
        f"{limit:,}".replace(",", "\N{NO-BREAK SPACE}")
        if isinstance(limit, int)
        else f"{limit:g}"
        if isinstance(limit, float)
        else limit
    )


def _description(schema: Schema, root: Schema) -> str:
    """The key's own description; else that of what it is a section of."""
    if "description" in schema:
        return str(schema["description"])
    return next((str(form["description"]) for form in _forms(schema, root) if "description" in form), "")
