"""Words in a figure: their width before they are drawn, lines broken at a width, and dollars that stay dollars."""

from functools import lru_cache

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from ...orchestrator.quoting import shortened
from .line_breaks import in_lines

#: Characters of a name that a figure shows.
_LONGEST = 90

#: Points in an inch.
POINTS = 72.0


def plain(text: str) -> str:
    """`text` as Matplotlib shows it letter by letter: a dollar sign would begin a formula."""
    return text.replace("$", r"\$")


@lru_cache(maxsize=4096)
def width_in(text: str, size: float) -> float:
    """The width of a line of text in inches, at this size in points."""
    width, _, _ = text_to_path.get_text_width_height_descent(text, FontProperties(size=size), ismath=False)
    return float(width) / POINTS


def broken(text: str, size: float, longest_in: float) -> list[str]:
    """`text` in lines that are not wider than `longest_in` inches; words that are wider are cut."""
    return in_lines(text, longest_in, lambda line: width_in(line, size))


def name_lines(text: str, size: float, longest_in: float) -> list[str]:
    """The same for a name that a file gave, which may be of any length; there is at least one line."""
    return broken(shortened(text, _LONGEST), size, longest_in) or [""]
