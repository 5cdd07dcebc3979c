"""What a shell completes: the files that a command takes, by their endings."""

from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

#: Folders in folders that are looked into, entries that are looked at, and files that are offered.
_DEEPEST, _MOST_ENTRIES, _MOST = 2, 2000, 200

#: Endings of the files that a person gives.
SCENARIOS, STUDIES, FMUS = (".yaml", ".yml", ".ssp"), (".yaml", ".yml"), (".fmu",)


def files_ending(*endings: str) -> Callable[[str], list[str]]:
    """A completion by the files with such `endings`, those in folders included.

    A folder itself is not offered: the shell would take it for the whole answer.
    """

    def completed(incomplete: str) -> list[str]:
        folder, _, begin = incomplete.rpartition("/")
        before = f"{folder}/" if "/" in incomplete else ""
        try:
            entries = sorted(Path(before or ".").expanduser().iterdir())
        except (OSError, RuntimeError):
            return []
        chosen = [entry for entry in entries if entry.name.startswith(begin) and _is_shown(entry, begin)]
        found = (name for entry in chosen for name in _files(entry, entry.name, endings, _DEEPEST))
        return [f"{before}{name}" for name in islice(found, _MOST)]

    return completed


def _files(path: Path, name: str, endings: tuple[str, ...], depth: int) -> Iterator[str]:
    """The name of the file at `path` if it ends so, or of those in the folder that it is."""
    try:
        if path.is_dir() and depth:
            for entry in sorted(islice(path.iterdir(), _MOST_ENTRIES)):
                if _is_shown(entry):
                    yield from _files(entry, f"{name}/{entry.name}", endings, depth - 1)
        elif path.suffix.lower() in endings and path.is_file():
            yield name
    # What may not be read is not offered.
    except OSError:
        return


def _is_shown(path: Path, begin: str = "") -> bool:
    return begin.startswith(".") or not path.name.startswith(".")
