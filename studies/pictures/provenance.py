"""What is said below the picture of a study: where its numbers are from."""

from collections.abc import Mapping, Sequence
from typing import Any

#: What is said of the entries that a machine has; of others their own name.
_MACHINE = {
    "processor": "{}",
    "cores": "{} cores",
    "memory_GB": "{} GB of memory",
    "system": "{}",
    "python": "Python {}",
}


def machine_text(machine: Mapping[str, Any]) -> str:
    """A sentence on the machine; empty where it is not known."""
    said = [_MACHINE[key].format(value) if key in _MACHINE else f"{key} {value}" for key, value in machine.items()]
    return f"Machine: {', '.join(said)}." if said else ""


def versions_text(versions: Mapping[str, str]) -> str:
    """A sentence on the versions of the program and of what it stands on; empty where they are not known."""
    said = ", ".join(f"{name} {version}" for name, version in versions.items())
    return f"Versions: {said}." if said else ""


def note_texts(notes: Sequence[str]) -> list[str]:
    """The notes as sentences."""
    return [f"{note[:1].upper()}{note[1:]}{'' if note.endswith('.') else '.'}" for note in notes]
