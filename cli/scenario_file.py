"""The file that a command is about: opened, and in front of whatever is wrong with its content."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..orchestrator.errors import InputError
from ..orchestrator.scenario import Scenario, load_scenario, parsed_assignments
from .completion import SCENARIOS, files_ending

if TYPE_CHECKING:
    from ..studies.plan import Variants

ScenarioFile = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="The scenario: a YAML file, or a system package (.ssp).",
        autocompletion=files_ending(*SCENARIOS),
    ),
]
Assignments = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY.PATH=VALUE", help="Set a key of the scenario to another value; may be repeated."
    ),
]

#: A system package as a scenario file, beside what was unpacked; YAML reads JSON too.
_RESOLVED = "resolved-scenario.json"


@contextmanager
def opened(file: Path, assignments: list[str]) -> Iterator[tuple[Scenario, Path]]:
    """The scenario in `file`, and the folder that its paths are relative to."""
    if file.suffix.lower() != ".ssp":
        yield load_scenario(file, assignments), file.parent
        return
    # Imported here, so that scenarios do not wait for what reads packages.
    from ..orchestrator.ssp import open_package

    with open_package(file, assignments, lambda text: typer.echo(f"note: {text}", err=True)) as package:
        yield package


def variants(file: Path, assignments: list[str], scenario: Scenario, base: Path) -> "Variants":
    """What `opened` gave, to be run with other settings too, for as long as it is open."""
    # Imported here, so that a run does not wait for what studies need.
    from ..studies.plan import Variants

    if file.suffix.lower() != ".ssp":
        return Variants(file, parsed_assignments(assignments), str(file))
    content = base / _RESOLVED
    content.write_text(json.dumps(scenario.resolved()), encoding="utf-8")
    return Variants(content, {}, str(file))


@contextmanager
def about(file: Path) -> Iterator[None]:
    """Put the scenario file in front of what is wrong with its content."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
