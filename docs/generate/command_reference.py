"""The page docs/reference/commands.md: all commands, their arguments and options, from the command itself."""

from collections.abc import Iterable
from inspect import cleandoc
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer.main
from cardiac_cosim.cli.app import app

PAGE = Path(__file__).parents[1] / "reference" / "commands.md"

_HEAD = """\
# Commands

Written by `python docs/generate` from the command `cosim` itself; `cosim --help` and `cosim COMMAND --help` say the
same.

Exit codes of all commands: 0 for done; 2 where the input is wrong; 3 where the physics or the coupling failed, or the
operating system refused to write; 128 and the number of the signal where a signal stopped the command; 1 is a bug.

"""

#: What a value is called where the option has no word of its own for it.
_KINDS = {Path: "PATH", int: "WHOLE NUMBER", float: "NUMBER", str: "TEXT"}


def page() -> str:
    """Its text."""
    group: Any = typer.main.get_command(app)
    list_of_all = [f"- [`cosim {name}`](#cosim-{name}): {_summary(group.commands[name])}" for name in group.commands]
    general = _options([item for item in group.params if _is_option(item)], group.callback)
    head = ["\n".join(list_of_all), *(["## Options of `cosim` itself", general] if general else [])]
    return _HEAD + "\n\n".join([*head, *map(_command, group.commands.values())]) + "\n"


def _summary(command: Any) -> str:
    return _text(cleandoc(command.help or "").split("\n\n")[0])


def _command(command: Any) -> str:
    arguments = [item for item in command.params if not _is_option(item)]
    options = [item for item in command.params if _is_option(item)]
    usage = " ".join(["cosim", command.name, *(item.metavar or item.name.upper() for item in arguments), "[OPTIONS]"])
    paragraphs = [_text(each) for each in cleandoc(command.help or "").split("\n\n")]
    rows = [f"| `{item.metavar or item.name.upper()}` | {_text(item.help)} |" for item in arguments]
    blocks = [f"## `cosim {command.name}`", *paragraphs, f"Usage: `{usage}`"]
    blocks += ["\n".join(["| argument | what it is |", "|---|---|", *rows])] if rows else []
    return "\n\n".join([*blocks, *([_options(options, command.callback)] if options else [])])


def _options(options: Iterable[Any], callback: Any) -> str:
    rows = [
        f"| {', '.join(f'`{name}`' for name in (*item.opts, *item.secondary_opts))} | {_value(item, callback)} "
        f"| {_default(item)} | {_text(item.help)} |"
        for item in options
    ]
    return "\n".join(["| option | value | default | what it does |", "|---|---|---|---|", *rows]) if rows else ""


def _is_option(item: Any) -> bool:
    return item.param_type_name == "option" and not item.hidden


def _value(option: Any, callback: Any) -> str:
    if option.is_flag:
        return ""
    if option.metavar:
        return f"`{_text(option.metavar)}`"
    annotation, *about = get_args(get_type_hints(callback, include_extras=True)[option.name])
    kind = next((name for kind, name in _KINDS.items() if annotation is kind or kind in get_args(annotation)), "TEXT")
    limits = [f"≥ {info.min}" for info in about if getattr(info, "min", None) is not None]
    limits += [f"≤ {info.max}" for info in about if getattr(info, "max", None) is not None]
    return f"`{kind}`{' ' if limits else ''}{', '.join(limits)}"


def _default(option: Any) -> str:
    if option.is_flag and option.secondary_opts:
        return f"`{(option.opts if option.default else option.secondary_opts)[0]}`"
    return "" if option.is_flag or option.default is None else f"`{option.default}`"


def _text(text: str | None) -> str:
    """On one line, with what Markdown would take for its own marked."""
    line = " ".join((text or "").split())
    return line.replace("|", "\\|").replace("<", "\\<")
