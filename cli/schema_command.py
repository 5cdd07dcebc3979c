"""`cosim schema`: the JSON schemas of scenario and study files, by which editors complete keys."""

import json
from enum import StrEnum
from typing import Annotated

import typer


class Kind(StrEnum):
    """The files that a person writes."""

    SCENARIO = "scenario"
    STUDY = "study"
    STABILITY = "stability"


def schema(
    kind: Annotated[
        Kind,
        typer.Argument(
            metavar="[scenario|study|stability]",
            help="Of which files: scenarios, studies for `cosim chart`, or studies for `cosim stability`.",
        ),
    ] = Kind.SCENARIO,
) -> None:
    """Print the JSON schema of scenario files, or of study files.

    An editor that is given the schema completes keys, shows their descriptions and marks mistakes. A file refers to it
    in a comment line, `# yaml-language-server: $schema=PATH`, as all files that come with the project do.
    """
    typer.echo(schema_text(kind))


def schema_text(kind: Kind) -> str:
    """The schema of files of a kind, as JSON."""
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.scenario_schema import scenario_schema
    from ..studies.study_schema import chart_schema, stability_schema

    made = {Kind.SCENARIO: scenario_schema, Kind.STUDY: chart_schema, Kind.STABILITY: stability_schema}[kind]()
    return json.dumps(made, indent=2, ensure_ascii=False)
