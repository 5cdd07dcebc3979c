"""Scenarios from system packages (SSP 1.0): this project's own, which say how they are coupled, and those of others."""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import ceil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...fmus.ssp import ANNOTATION
from ..errors import InputError
from ..scenario import Scenario, checked
from .component import SystemComponent
from .connections import connections
from .file import named, unpack
from .parameters import parameters

_MS_PER_S = 1000.0

#: Steps of a run whose package and FMUs say nothing of a step.
_STEPS = 100

_UNSUPPORTED = {
    "ssd:Elements/ssd:System": "a system inside the system",
    "ssd:Elements/ssd:SignalDictionaryReference": "a signal dictionary",
    "ssd:SignalDictionaries/ssd:SignalDictionary": "a signal dictionary",
}


@contextmanager
def open_package(
    path: Path, assignments: Sequence[str] = (), tell: Callable[[str], None] = print
) -> Iterator[tuple[Scenario, Path]]:
    """The scenario in the system package `path`, changed by `assignments`, and the folder its paths are relative to.

    The package is unpacked for as long as the context lasts. What of it is not used is told to `tell`. InputError names
    the file, the key and the remedy.
    """
    with TemporaryDirectory(prefix="cosim-ssp-") as name:
        folder = Path(name)
        try:
            content = _content(unpack(path, folder), folder, tell)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        assigned = {text.partition("=")[0].strip() for text in assignments}
        if "stop_ms" not in content["run"] and not assigned & {"run", "run.stop_ms"}:
            raise InputError(f"{path}: the package has no stop time; give one by --set run.stop_ms=...")
        yield checked(content, path, assignments), folder


def _content(root: Any, folder: Path, tell: Callable[[str], None]) -> dict[str, Any]:
    """What a scenario file would say."""
    system = next(named(root, "ssd:System"))
    for path, what in _UNSUPPORTED.items():
        for element in named(system, path):
            label = element.get("name") or element.get("dictionary")
            raise InputError(f"'{label}' is {what}, which is not supported; only FMUs can be coupled")
    parts = _parts(system, folder)
    given = parameters(system, parts, folder, tell)
    links = [str(connection) for connection in connections(system, parts)]
    units: dict[str, dict[str, Any]] = {}
    for part in parts:
        values = given[part.unit].items()
        own = {name for name, _ in values if part.variables[name].causality == "parameter"}
        units[part.unit] = {
            "fmu": part.source,
            "parameters": {name: value for name, value in values if name in own},
            "start": {name: value for name, value in values if name not in own},
        }
    content = {
        "name": _identifier(root.get("name"), r"[^\w.-]"),
        "units": units,
        "connections": links,
        # In a package what is not connected is not meant to be.
        "connect_by_name": False,
    }
    own_content = _annotation(root)
    for name, every in own_content.pop("every", {}).items():
        if name in units:
            units[name]["every"] = every
    return content | _times(root, parts) | own_content


def _parts(system: Any, folder: Path) -> list[SystemComponent]:
    parts: list[SystemComponent] = []
    for element in named(system, "ssd:Elements/ssd:Component"):
        unit = _identifier(element.get("name"), r"\W")
        for other in parts:
            if other.unit == unit:
                raise InputError(
                    f"components '{other.label}' and '{element.get('name')}' have too similar names; rename one"
                )
        parts.append(SystemComponent(element, unit, folder))
    if not parts:
        raise InputError("the system has no components, so there is nothing to run")
    return parts


def _identifier(name: str, forbidden: str) -> str:
    """`name` as scenarios have names: begun by a letter, and without the characters that are `forbidden`."""
    plain = re.sub(forbidden, "_", name)
    return plain if plain[:1].isalpha() else f"x{plain}"


def _times(root: Any, parts: Sequence[SystemComponent]) -> dict[str, Any]:
    """The run as the package has it, with the smallest step that an FMU proposes, or a hundredth of the whole."""
    experiment = next(named(root, "ssd:DefaultExperiment"), None)
    start, stop = (None if experiment is None else experiment.get(key) for key in ("startTime", "stopTime"))
    if start is not None and float(start) != 0.0:
        raise InputError(f"the default experiment starts at {start} s; only runs that start at 0 are supported")
    if stop is None:
        return {"run": {}}
    stop_ms = _milliseconds(float(stop))
    if not stop_ms > 0.0:
        raise InputError(f"the default experiment stops at {stop} s, before it has begun")
    proposed = [
        float(part.description.defaultExperiment.stepSize) * _MS_PER_S
        for part in parts
        if part.description.defaultExperiment is not None and part.description.defaultExperiment.stepSize is not None
    ]
    steps = ceil(stop_ms / min(proposed) - 1e-9) if proposed and min(proposed) > 0.0 else _STEPS
    # One output, at the end: so any other step that divides the time will do.
    times = {"coupling": {"step_ms": stop_ms / steps}, "output": {"every_ms": stop_ms}}
    return {"run": {"stop_ms": stop_ms}} | times


def _milliseconds(seconds: float) -> float:
    """Without what the multiplication adds in the last digits."""
    return float(f"{seconds * _MS_PER_S:.12g}")


def _annotation(root: Any) -> dict[str, Any]:
    """What this project's own packages say beyond the standard; nothing of others."""
    for annotation in named(root, "ssd:Annotations/ssc:Annotation"):
        if annotation.get("type") != ANNOTATION:
            continue
        try:
            kept = json.loads("".join(annotation.itertext()))
            stop = next(named(root, "ssd:DefaultExperiment")).get("stopTime")
            # Another tool may have changed what the standard has a place for.
            if _milliseconds(float(stop)) != _milliseconds(kept["run"]["stop_ms"] / _MS_PER_S):
                kept["run"]["stop_ms"] = _milliseconds(float(stop))
        except (ValueError, KeyError, TypeError, StopIteration) as error:
            raise InputError(f"the annotation {ANNOTATION} cannot be read ({error!r}); remove it") from None
        return dict(kept)
    return {}
