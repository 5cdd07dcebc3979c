"""The page docs/decisions/README.md: the list of all decisions, by their titles."""

from pathlib import Path

_FOLDER = Path(__file__).parents[1] / "decisions"
PAGE = _FOLDER / "README.md"

_HEAD = """\
# Decisions

Written by `python docs/generate` from the files of this folder.

Each page records one decision that was not obvious: what was decided, what it rests on, and what was turned down. How
a new one is added is said in [Working on cardiac-cosim](../../CONTRIBUTING.md).

"""


def page() -> str:
    """Its text."""
    files = sorted(_FOLDER.glob("[0-9]*.md"))
    return _HEAD + "".join(f"- {path.name[:4]}: [{_title(path)}]({path.name})\n" for path in files)


def _title(path: Path) -> str:
    return path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
