"""A page in one file, which works without a network, and what Plotly draws in it."""

from plotly.graph_objects import Figure
from plotly.io import to_html

from .markup import safe

#: The browser is to load nothing, whatever names and reasons in a study say.
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"

#: The bar to scroll by is always there, for a figure is drawn before it is known whether there will be one.
_STYLE = """
html { overflow-y: scroll }
body { font-family: sans-serif; color: #222; margin: 1.5em auto; max-width: 80em; padding: 0 1em; line-height: 1.4 }
table { border-collapse: collapse; font-size: 0.85em }
th, td { border: 1px solid #ccc; padding: 0.25em 0.5em; text-align: left; vertical-align: top }
td:first-child { min-width: 11em }
td.number { text-align: right; white-space: nowrap }
th { background: #f2f2f2; position: sticky; top: 0 }
.wide { overflow-x: auto }
"""

_BUTTONS = ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]


def document(title: str, body: str, style: str = "") -> str:
    """The whole page: `title` is other people's text, `body` is HTML that stands below it, `style` rules of its own."""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{safe(title)}</title>
<style>{_STYLE}{style}</style>
</head>
<body>
<h1>{safe(title)}</h1>
{body}
</body>
</html>
"""


def embedded(figure: Figure, name: str, with_program: bool = True) -> str:
    """A figure as a part of a page, in an element with the id `name`; one figure of a page brings Plotly's program."""
    config: dict[str, object] = {"displaylogo": False, "responsive": True, "doubleClick": "reset"}
    config["modeBarButtons"] = [_BUTTONS]
    return str(
        to_html(figure, config, include_plotlyjs=with_program, full_html=False, div_id=name, default_height="auto")
    )


def table(head: list[str], rows: list[str]) -> str:
    """A table that scrolls by itself where it is wide: names of columns, and rows of `cell`s joined."""
    names = "".join(f"<th>{safe(name)}</th>" for name in head)
    lines = "\n".join(f"<tr>{row}</tr>" for row in rows)
    return f'<div class="wide">\n<table>\n<thead><tr>{names}</tr></thead>\n<tbody>\n{lines}\n</tbody>\n</table>\n</div>'


def cell(content: str, kind: str = "") -> str:
    """A cell of a table; `content` is HTML, `kind` how it looks, as `number`."""
    return f'<td class="{kind}">{content}</td>' if kind else f"<td>{content}</td>"
