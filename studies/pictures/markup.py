"""Other people's text, escaped for HTML, which Plotly reads too."""

from html import escape

from ...orchestrator.quoting import shortened
from .line_breaks import in_lines

#: Characters of a text, and of a line of it.
_LONGEST, _LINE = 500, 90

#: What stands where nothing is known.
NOTHING = "–"


def safe(text: str) -> str:
    """`text`, not too long, as its letters: HTML and Plotly both take what looks like tags and entities for such."""
    return escape(shortened(text, _LONGEST), quote=False)


def safe_lines(text: str, longest: int = _LINE) -> str:
    """The same in lines."""
    return (
        "<br>".join(escape(line, quote=False) for line in in_lines(shortened(text, _LONGEST), longest, len)) or "&nbsp;"
    )
