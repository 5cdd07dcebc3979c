"""The parameters of a scenario's units: what they are, what they are allowed to be, and what the scenario sets."""

from collections.abc import Iterator, Sequence
from pathlib import PurePath
from typing import Any

from ..participants.native import unit_parameters
from ..scenario import Scenario, UnitEntry

_HEAD = ("", "parameter", "value", "default", "unit of measure", "allowed", "description")

#: What marks a parameter that the scenario changes.
_CHANGED = "*"


def parameter_table(scenario: Scenario) -> str:
    """A table for every unit, in which what differs from the default is marked.

    Of an FMU that is none of our units it has what the scenario sets; its other parameters are in the FMU.
    """
    parts = [f"{scenario.name}: parameters of the units; '{_CHANGED}' marks those that differ from their default"]
    for name, entry in scenario.units.items():
        title = f"{name}: {entry.unit or PurePath(str(entry.fmu)).name}"
        rows = list(_rows(entry))
        lines = _aligned([_HEAD, *rows]) if rows else ["no parameters" if entry.unit else "the scenario sets none"]
        parts.append("\n".join([title, *(f"  {line}" for line in lines)]))
    return "\n\n".join(parts)


def _rows(entry: UnitEntry) -> Iterator[Sequence[str]]:
    if entry.unit is None:
        for name, value in (entry.parameters | entry.start).items():
            yield _CHANGED, name, _text(value), "", "", "", "set by the scenario"
        return
    for parameter in unit_parameters(entry.unit):
        value = entry.parameters.get(parameter.name, parameter.default)
        yield (
            "" if value == parameter.default else _CHANGED,
            parameter.name,
            _text(value),
            _text(parameter.default),
            "" if parameter.measure == "1" or parameter.choices else parameter.measure,
            parameter.limits,
            parameter.description,
        )


def _text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _aligned(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
