"""Scenarios from system packages (SSP 1.0, 2.0): this project's own, which say how they are coupled, and others'."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import ceil, inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..coupling.connections import Connection
from ..errors import InputError
from ..quoting import quoted, shortened
from ..scenario import Scenario, checked
from .component import SystemComponent
from .connections import connections
from .file import inside, named, unpack
from .parameters import parameters
from .tree import identifier, tree
from .vocabulary import ANNOTATION
from .wiring import Wiring

_MS_PER_S = 1000.0

#: Steps of a run whose package and FMUs say nothing of a step.
_STEPS = 100

#: What an annotation of this project says, and the kinds of it; units and connections are the standard's.
_KEPT = {"coupling": dict, "run": dict, "output": dict, "every": dict, "scene": dict}

#: Values that are told not to be used.
_MOST_NOTES = 20

#: Characters of what is wrong with it that are told.
_LONGEST_REASON = 200

#: Characters of an annotation: a hundred times what is written there.
_LONGEST_ANNOTATION = 1_000_000


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
            notes: list[str] = []
            content = _content(unpack(path, folder), folder, notes.append)
            for note in notes[:_MOST_NOTES]:
                tell(note)
            if len(notes) > _MOST_NOTES:
                tell(f"and {len(notes) - _MOST_NOTES} more parameter values are not used")
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        assigned = {text.partition("=")[0].strip() for text in assignments}
        if "stop_ms" not in content["run"] and not assigned & {"run", "run.stop_ms"}:
            raise InputError(f"{path}: the package has no stop time; give one by --set run.stop_ms=...")
        yield checked(content, path, assignments), folder


def _content(root: Any, folder: Path, tell: Callable[[str], None]) -> dict[str, Any]:
    """What a scenario file would say."""
    whole = tree(root, folder)
    parts = list(whole.components())
    wiring = Wiring(whole)
    given = parameters(whole, wiring, tell)
    links = [_written(connection) for connection in connections(wiring)]
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
        "name": identifier(root.get("name"), allowed=".-"),
        "units": units,
        "connections": links,
        # In a package what is not connected is not meant to be.
        "connect_by_name": False,
    }
    own_content = _annotation(root, folder)
    # What is no number is refused with the scenario.
    for name, every in own_content.pop("every", {}).items():
        if name in units:
            units[name]["every"] = every
    return content | _times(root, parts) | own_content


def _written(connection: Connection) -> str | dict[str, Any]:
    """A connection as scenarios have it; as an entry, where the names in it could not be told apart in a text."""
    text = str(connection)
    # A text begins with the name of a unit.
    return connection.entry() if text.startswith("{") else text


def _times(root: Any, parts: Sequence[SystemComponent]) -> dict[str, Any]:
    """The run as the package has it, with the smallest step that an FMU proposes, or a hundredth of the whole."""
    experiment = next(named(root, "ssd:DefaultExperiment"), None)
    start, stop = (None if experiment is None else experiment.get(key) for key in ("startTime", "stopTime"))
    if start is not None and float(start) != 0.0:
        raise InputError(f"the default experiment starts at {start} s; only runs that start at 0 are supported")
    if stop is None:
        return {"run": {}}
    stop_ms = _milliseconds(float(stop))
    if not 0.0 < stop_ms < inf:
        raise InputError(f"the default experiment stops at {stop} s; the stop time has to be finite and above 0")
    proposed = [step for part in parts if (step := _proposed_ms(part)) is not None]
    # What is more steps than anybody waits for is refused with the scenario, which names both.
    steps = ceil(min(stop_ms / min(proposed), 1e18) - 1e-9) if proposed else _STEPS
    # One output, at the end: so any other step that divides the time will do.
    times = {"coupling": {"step_ms": stop_ms / steps}, "output": {"every_ms": stop_ms}}
    return {"run": {"stop_ms": stop_ms}} | times


def _proposed_ms(part: SystemComponent) -> float | None:
    """The step that an FMU proposes, if it does."""
    experiment = part.description.defaultExperiment
    if experiment is None or experiment.stepSize is None:
        return None
    try:
        step = float(experiment.stepSize) * _MS_PER_S
    except ValueError:
        return None
    return step if 0.0 < step < inf else None


def _milliseconds(seconds: float) -> float:
    """Without what the multiplication adds in the last digits."""
    return float(f"{seconds * _MS_PER_S:.12g}")


def _annotation(root: Any, folder: Path) -> dict[str, Any]:
    """What this project's own packages say beyond the standard; nothing of others."""
    for annotation in named(root, "ssd:Annotations/ssc:Annotation"):
        if annotation.get("type") != ANNOTATION:
            continue
        text = "".join(annotation.itertext())
        try:
            if len(text) > _LONGEST_ANNOTATION:
                raise ValueError(f"it has more than {_LONGEST_ANNOTATION} characters")
            kept = json.loads(text)
            if not isinstance(kept, dict) or not kept:
                raise ValueError("it is not a section")
            for key, value in kept.items():
                if not isinstance(value, _KEPT.get(key, ())):
                    raise ValueError(f"{quoted(key)} does not belong there, or is not a section")
            stop = next(named(root, "ssd:DefaultExperiment")).get("stopTime")
            # Another tool may have changed what the standard has a place for.
            if _milliseconds(float(stop)) != _milliseconds(kept["run"]["stop_ms"] / _MS_PER_S):
                kept["run"]["stop_ms"] = _milliseconds(float(stop))
        except (ArithmeticError, LookupError, RecursionError, StopIteration, TypeError, ValueError) as error:
            reason = shortened(f"{type(error).__name__}: {error}", _LONGEST_REASON)
            raise InputError(f"the annotation {ANNOTATION} cannot be read ({reason}); remove it") from None
        _check_reach(kept, folder)
        return kept
    return {}


def _check_reach(kept: dict[str, Any], folder: Path) -> None:
    """InputError if an annotation reaches out of the package: to files of the person's, or to other machines."""
    mesh = kept.get("scene", {}).get("mesh")
    if isinstance(mesh, str):
        inside(folder, mesh, f"the mesh of the annotation {ANNOTATION}", folder)
    workers = kept["run"].get("workers")
    if isinstance(workers, str) and "://" in workers:
        raise InputError(
            f"the annotation {ANNOTATION} sends the units to {shortened(workers)}; a package must not choose other "
            "machines: remove it there, and use --set run.workers=..."
        )
