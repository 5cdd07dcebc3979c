"""A map as a page in one file, which works without a network: panels to hover over, and a table of all cells."""

from pathlib import Path

from ...orchestrator.results.whole import write_whole
from ..pictures.document import cell, document, embedded, table
from ..pictures.markup import NOTHING, safe
from ..pictures.provenance import versions_text
from ..point import told, value_text
from .axis_words import axis_words
from .caption import error_text, sentences, title
from .counts import counted
from .key import BETWEEN, MEASURED, theory_words
from .look import LOOKS, TILE_PX
from .map import Cell, Panel, StabilityMap
from .placed_panel import PlacedPanel, placed_panel
from .plot import plot
from .telling import growth_text, wall_text

_STYLE = """
.panels { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(30em, 100%), 1fr)); gap: 0 1.5em }
.panel { min-width: 0 }
.panel h2 { font-size: 1em; margin: 1em 0 0.2em; overflow-wrap: anywhere }
.key { list-style: none; padding: 0; display: flex; flex-wrap: wrap; gap: 0.3em 1.4em }
svg.sign { width: 32px; height: 16px; vertical-align: -3px; margin-right: 0.5em }
svg.patterns { position: absolute; width: 0; height: 0 }
h1, p, li { overflow-wrap: anywhere }
h1 { font-size: 1.5em }
td { max-width: 24em; overflow-wrap: break-word }
"""

_LINE = '<line x1="0" y1="8" x2="32" y2="8" stroke="black" stroke-width="4"/>'
_DIAMOND = (
    '<path d="M16 0V16M12 0.5H20M12 15.5H20" stroke="black" stroke-width="1.5"/>'
    '<path d="M16 3L21 8L16 13L11 8Z" fill="white" stroke="black" stroke-width="1.5"/>'
)
_STRIP = '<line x1="4" y1="8" x2="28" y2="8" stroke="#444" stroke-width="3"/>'


def write_page(found: StabilityMap, folder: Path, stem: str = "stability") -> Path:
    """Write `stability.html` into `folder`, or the same called after `stem`; returns the file."""
    path = folder / f"{stem}.html"
    write_whole(path, page(found).encode())
    return path


def page(found: StabilityMap) -> str:
    """The whole page; ValueError for a cell that is neither on its grid nor bisected."""
    placed = [placed_panel(panel) for panel in found.panels]
    about = "\n".join(f"<li>{safe(text)}</li>" for text in _about(found, placed))
    panels = "\n".join(
        f'<div class="panel">\n<h2>{safe(each.panel.name)}</h2>\n'
        f"{embedded(plot(each), f'panel{number}', with_program=number == 0)}\n</div>"
        for number, each in enumerate(placed)
    )
    body = f"""{_patterns()}
{_key(found, placed)}
<div class="{"panels" if len(placed) > 1 else "one"}">
{panels}
</div>
<p>Hover over a box to see the data of its run. The numbers in brackets count the cells.</p>
<ul>
{about}
</ul>
<h2>All cells</h2>
{_table(found)}"""
    return document(title(found), body, _STYLE)


# --- inside -----------------------------------------------------------------------------------------------------------


def _about(found: StabilityMap, placed: list[PlacedPanel]) -> list[str]:
    keys = {key: axis_words(key) for panel in found.panels for key in (panel.x_key, panel.y_key)}
    words = [f"{key}: {text}" for key, text in keys.items() if text != key]
    texts = [
        *sentences(found, placed),
        f"In words: {'; '.join(words)}." if words else "",
        versions_text(found.versions),
    ]
    return [text for text in texts if text]


def _patterns() -> str:
    """The hatching of all classes, for the signs of this page."""
    patterns = "".join(
        f'<pattern id="{_name(kind)}" width="{TILE_PX}" height="{TILE_PX}" patternUnits="userSpaceOnUse">'
        f'<rect width="{TILE_PX}" height="{TILE_PX}" fill="{look.color}"/>'
        f'<path d="{look.tile}" fill="{look.ink}" stroke="{look.ink}" stroke-width="1.3"/></pattern>'
        for kind, look in LOOKS.items()
    )
    return f'<svg class="patterns" aria-hidden="true"><defs>{patterns}</defs></svg>'


def _key(found: StabilityMap, placed: list[PlacedPanel]) -> str:
    said = [f"{_swatch(kind)}{safe(kind)} ({number})" for kind, number in counted(found.cells).items()]
    if any(each.limit for each in placed):
        said.append(_sign(_LINE) + safe(theory_words(found)))
    if any(each.crossings for each in placed):
        said.append(_sign(_DIAMOND) + MEASURED)
    if any(each.marks for each in placed):
        said.append(_sign(_STRIP) + BETWEEN)
    return '<ul class="key">\n' + "\n".join(f"<li>{text}</li>" for text in said) + "\n</ul>"


def _swatch(kind: str) -> str:
    return _sign(f'<rect x="0.5" y="0.5" width="31" height="15" fill="url(#{_name(kind)})" stroke="#999"/>')


def _sign(content: str) -> str:
    return f'<svg class="sign" viewBox="0 0 32 16" aria-hidden="true">{content}</svg>'


def _name(kind: str) -> str:
    return f"look-{kind.replace(' ', '-')}"


def _table(found: StabilityMap) -> str:
    keys = list(dict.fromkeys((panel.x_key, panel.y_key) for panel in found.panels))
    axes = keys[0] if len(keys) == 1 else ("x axis", "y axis")
    measures = list(dict.fromkeys(name for each in found.cells for name in each.errors))
    head = ["line", *axes, "class", "measured growth", "predicted growth"]
    head += [*(f"error in {name}" for name in measures), "wall clock", "run of the bisection", "reason"]
    rows = [_row(panel, each, measures, len(keys) > 1) for panel in found.panels for each in panel.cells]
    return table(head, rows)


def _row(panel: Panel, each: Cell, measures: list[str], with_keys: bool) -> str:
    cells = [cell(safe(panel.name))]
    for key, value in ((panel.x_key, each.x), (panel.y_key, each.y)):
        cells.append(cell(safe(told({key: value}) if with_keys else value_text(value))))
    cells.append(cell(_swatch(each.kind) + safe(each.kind)))
    cells += [cell(growth_text(each.measure), "number"), cell(growth_text(each.predicted), "number")]
    for name in measures:
        known = name in each.errors
        cells.append(cell(safe(error_text(name, each.errors[name])) if known else NOTHING, "number"))
    cells += [cell(wall_text(each), "number"), cell("yes" if each.bisected else ""), cell(safe(each.reason))]
    return "".join(cells)
