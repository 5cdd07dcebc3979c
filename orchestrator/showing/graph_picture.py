"""A picture of a scenario's graph: laid out as the diagram of a system package is, drawn by Matplotlib.

Readable without colour: how a value is read is told by dashes, and loops by thick lines.
"""

import io
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ..errors import InputError
from ..results.whole import write_whole
from ..ssp.export.diagram import PITCH, Box, Diagram, Point
from ..writing import writing
from .graph import Edge, Graph, Node, Reading

#: The formats of pictures, by the ending of a file.
ENDINGS = (".svg", ".png", ".pdf")

_DOTS_PER_INCH, _MM_PER_INCH = 160, 25.4

#: The same SVG for the same content, with letters as letters.
_SETTINGS = {"svg.hashsalt": "cardiac-cosim", "svg.fonttype": "none", "font.family": "DejaVu Sans"}

_DASHES = {
    Reading.SAME_SWEEP: "solid",
    Reading.BEFORE: (0, (5, 2.5)),
    Reading.ONCE: (0, (1, 2)),
    Reading.FILE: (0, (6, 1.5, 1, 1.5)),
}
_LOOP, _PLAIN, _PALE = "#b2182b", "#222222", "#666666"
_THICK, _THIN = 2.2, 1.0

#: Heights in mm: of the title, of its notes, and of a line of the legend; the legend's sample.
_TITLE, _NOTE, _LEGEND, _SAMPLE = 8.0, 5.5, 5.5, 14.0
_MARGIN = 6.0

#: The mm that a letter of the title, and of the words below it, is wide.
_TITLE_LETTER, _WORD_LETTER = 2.7, 2.0


def write_graph(graph: Graph, path: Path) -> None:
    """Draw `graph` into the file at `path`, in the format that its ending says.

    Raises
    ------
    InputError
        For another ending than those of `ENDINGS`, and for a place where nothing can be written.
    """
    check_ending(path)
    content = io.BytesIO()
    kind = path.suffix.lower().lstrip(".")
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
    with rc_context(_SETTINGS):
        figure = draw_graph(graph)
        figure.savefig(content, format=kind, dpi=_DOTS_PER_INCH, metadata=metadata)
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content.getvalue())


def check_ending(path: Path) -> None:
    """InputError for a file that is no picture of a kind that can be drawn."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(
            f"--graph {path}: a picture cannot be written as '{path.suffix}'; "
            f"let the name end in one of {', '.join(ENDINGS)}"
        )


def draw_graph(graph: Graph) -> Figure:
    """The picture of `graph`."""
    headings = {node.name: (_heading(node), *node.captions) for node in graph.nodes}
    pins: dict[str, tuple[list[str], list[str]]] = {node.name: ([], []) for node in graph.nodes}
    for edge in graph.edges:
        pins[edge.source][1].append(edge.output)
        pins[edge.target][0].append(edge.input)
    diagram = Diagram(_Drawn(graph), pins, headings)
    legend = _legend(graph)
    words = [len(graph.title) * _TITLE_LETTER]
    words += [len(note) * _WORD_LETTER for note in graph.notes]
    words += [_SAMPLE + len(text) * _WORD_LETTER for _, text in legend]
    canvas = diagram.canvas
    width = max(canvas.right - canvas.left, max(words) + 2 * _MARGIN)
    above = _TITLE + _NOTE * len(graph.notes)
    below = _LEGEND * len(legend)
    height = canvas.top - canvas.bottom + above + below + _MARGIN
    figure = Figure(figsize=(width / _MM_PER_INCH, height / _MM_PER_INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    left = canvas.left - (width - (canvas.right - canvas.left)) / 2.0
    axes.set(xlim=(left, left + width), ylim=(canvas.bottom - below - _MARGIN, canvas.top + above))
    axes.set_axis_off()
    for edge in graph.edges:
        _draw_edge(axes, diagram, edge, graph)
    for node in graph.nodes:
        _draw_node(axes, diagram, node, pins[node.name], headings[node.name])
    top = canvas.top + above - _MARGIN
    axes.text(left + _MARGIN, top, graph.title, size=12, weight="bold", va="center")
    for number, note in enumerate(graph.notes):
        axes.text(left + _MARGIN, top - _TITLE + 1.0 - _NOTE * number, note, size=9, va="center", color=_PLAIN)
    _draw_legend(axes, legend, left + _MARGIN, canvas.bottom)
    return figure


class _Drawn:
    """The graph as a system that can be laid out; the nodes are in the order of execution."""

    def __init__(self, graph: Graph) -> None:
        self.components = graph.nodes
        self.links = graph.edges
        self.order = [node.name for node in graph.nodes]


def _heading(node: Node) -> str:
    return node.name if node.place is None else f"{node.place}  {node.name}"


def _draw_node(
    axes: Axes, diagram: Diagram, node: Node, pins: tuple[list[str], list[str]], headings: tuple[str, ...]
) -> None:
    box = diagram.boxes[node.name]
    color, width = (_LOOP, _THICK) if node.in_loop else (_PLAIN, _THIN)
    corner, size = (box.left, box.bottom), (box.right - box.left, box.top - box.bottom)
    axes.add_patch(Rectangle(corner, *size, facecolor="white", edgecolor=color, linewidth=width))
    middle = (box.left + box.right) / 2.0
    for number, text in enumerate(headings):
        weight = "normal" if number else "bold"
        height = box.top - PITCH * (number + 0.65)
        axes.text(middle, height, text, size=7.5 if number else 9.5, weight=weight, ha="center", va="center")
    for kind, names in zip(("input", "output"), pins, strict=True):
        for name in dict.fromkeys(names):
            x, y = _end(diagram, node.name, kind, name)
            shift, side = (1.5, "left") if kind == "input" else (-1.5, "right")
            axes.text(x + shift, y, name, size=8, ha=side, va="center", color=_PLAIN)


def _draw_edge(axes: Axes, diagram: Diagram, edge: Edge, graph: Graph) -> None:
    begin, end = (
        _end(diagram, edge.source, "output", edge.output),
        _end(diagram, edge.target, "input", edge.input),
    )
    turns = diagram.way(edge)
    color = _LOOP if edge.in_loop else _PALE if edge.reading is Reading.ONCE else _PLAIN
    width = _THICK if edge.in_loop else _THIN
    x, y = zip(begin, *turns, end, strict=True)
    axes.plot(x, y, color=color, linewidth=width, linestyle=_DASHES[edge.reading], solid_joinstyle="miter")
    arrow = {"arrowstyle": "-|>", "color": color, "linewidth": 0.0, "mutation_scale": 13.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=end, xytext=(end[0] - 2.5, end[1]), arrowprops=arrow)
    shared = [other for other in graph.edges if (other.source, other.output) == (edge.source, edge.output)]
    if len(shared) > 1:
        axes.plot(*turns[0][:1], begin[1], marker="o", markersize=3.5, color=color)


def _legend(graph: Graph) -> list[tuple[Edge | None, str]]:
    """Samples and what they mean, of what is in the picture."""
    found: list[tuple[Edge | None, str]] = []
    for reading in Reading:
        if any(edge.reading is reading for edge in graph.edges):
            text = reading.value
            if reading is Reading.BEFORE:
                text = graph.before
            found.append((Edge("", "", "", "", reading), text))
    if any(edge.in_loop for edge in graph.edges):
        found.append((Edge("", "", "", "", Reading.SAME_SWEEP, True), "thick: algebraic loop"))
    places = [node.place for node in graph.nodes if node.place is not None]
    if places:
        equal = "; units of the same number step independently" if len(set(places)) < len(places) else ""
        found.append((None, f"place in the execution order{equal}"))
    return found


def _draw_legend(axes: Axes, legend: list[tuple[Edge | None, str]], left: float, top: float) -> None:
    for number, (edge, text) in enumerate(legend):
        height = top - _LEGEND * (number + 0.5)
        if edge is None:
            axes.text(left + _SAMPLE / 2.0 - 2.0, height, "1, 2, …", size=9, weight="bold", ha="center", va="center")
        else:
            color = _LOOP if edge.in_loop else _PALE if edge.reading is Reading.ONCE else _PLAIN
            width = _THICK if edge.in_loop else _THIN
            sample = [left, left + _SAMPLE - 4.0]
            axes.plot(sample, [height, height], color=color, linewidth=width, linestyle=_DASHES[edge.reading])
        axes.text(left + _SAMPLE, height, text, size=8.5, va="center", color=_PLAIN)


def _end(diagram: Diagram, component: str, kind: str, name: str) -> Point:
    """The place of a connector."""
    box: Box = diagram.boxes[component]
    x, y = diagram.pin(component, kind, name)
    return (box.left + x * (box.right - box.left), box.bottom + y * (box.top - box.bottom))
