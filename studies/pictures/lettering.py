"""Words in a figure: their width before they are drawn, lines broken at a width, and dollars that stay dollars."""

from functools import lru_cache

from matplotlib.font_manager import FontProperties
from matplotlib.textpath import text_to_path

from ...orchestrator.quoting import shortened

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
    lines, line = [], ""
    for word in text.split():
        while width_in(word, size) > longest_in:
            count = _fitting(word, size, longest_in)
            lines += [line] * bool(line) + [word[:count]]
            line, word = "", word[count:]
        longer = f"{line} {word}".strip()
        if width_in(longer, size) > longest_in:
            lines.append(line)
            longer = word
        line = longer
    return lines + [line] * bool(line)


def name_lines(text: str, size: float, longest_in: float) -> list[str]:
    """The same for a name that a file gave, which may be of any length; there is at least one line."""
    return broken(shortened(text, _LONGEST), size, longest_in) or [""]


def _fitting(word: str, size: float, longest_in: float) -> int:
    """How many letters of a long word fit, at least one."""
    count = max(int(len(word) * longest_in / width_in(word, size)), 1)
    while count > 1 and width_in(word[:count], size) > longest_in:
        count -= 1
    return count
