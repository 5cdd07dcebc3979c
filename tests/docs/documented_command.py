"""A call of `cosim` as a page shows it, taken apart by the command's own parser."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer.main
from cardiac_cosim.cli.app import app


@dataclass(frozen=True)
class DocumentedCommand:
    """The name of the command ("" for `cosim` alone), the files and folders it is given, and its options' values."""

    name: str
    places: tuple[Path, ...]
    options: dict[str, Any]

    @property
    def assignments(self) -> list[str]:
        """What `--set` has, and what other options make of it."""
        participants = self.options.get("participants")
        return [
            *(self.options.get("assignments") or ()),
            *([f"run.participants={participants}"] if participants else ()),
        ]

    @property
    def output(self) -> Path | None:
        """The folder that results go to, if it was given."""
        given = self.options.get("output")
        return None if given is None else Path(given)


def words_of(line: str) -> list[str]:
    """The words of a line of a shell behind the program, without comments and without where the output goes to."""
    words = shlex.split(line, comments=True)
    end = next((place for place, word in enumerate(words) if word in (">", "|", "2>")), len(words))
    return words[1:end]


def parsed(words: Sequence[str]) -> DocumentedCommand:
    """The call with these words; an exception of the parser's where there is no such command, argument or option."""
    group: Any = typer.main.get_command(app)
    start = next((place for place, word in enumerate(words) if word in group.commands), len(words))
    if start == len(words) and all(word.startswith("-") for word in words):
        # `cosim --help` and the like, which end the parser.
        return DocumentedCommand("", (), {})
    # Without what stands in front of the command this is the parser of what `cosim` itself knows.
    name, command, rest = group.resolve_command(group.make_context("cosim", list(words)), list(words[start:] or words))
    context = command.make_context(name, list(rest))
    arguments = {item.name for item in command.params if item.param_type_name == "argument"}
    values = [value for key, value in context.params.items() if key in arguments and value is not None]
    given = [each for value in values for each in (value if isinstance(value, list | tuple) else [value])]
    places = tuple(Path(each) for each in given if isinstance(each, Path))
    return DocumentedCommand(name, places, {k: v for k, v in context.params.items() if k not in arguments})
