"""The diagram of a system: where its components are drawn, their connectors, and the ways of the connections.

Components stand in columns from left to right, each to the right of those that feed it in the order of execution; what
is fed against that order, the closing of a loop, goes back below. Inputs are on the left side of a component, outputs
on its right. Connections run at right angles: through the gap between two columns, where every output has a track of
its own, or, if they have farther to go, along a lane above (forwards) or below (backwards) all columns. So no
connection crosses a component, and none lies on another but where both come from one output. All scalars of a field
are one connector here. Lengths are in mm, x to the right and y upwards (SSP 2.0, section on SystemGeometry).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

Point = tuple[float, float]

#: Distance of connectors, tracks and lanes; of components in a column and in the margin; width of a letter.
PITCH, _GAP, _LETTER = 5.0, 15.0, 2.0


@dataclass(frozen=True)
class Box:
    """A rectangle whose sides are parallel to the axes."""

    left: float
    bottom: float
    right: float
    top: float


class Named(Protocol):
    """A component, as far as it is drawn."""

    @property
    def name(self) -> str:
        """What it is called."""


class Wired(Protocol):
    """A link between an output and an input, by the names of their components and their own."""

    @property
    def source(self) -> str:
        """The component of the output."""

    @property
    def output(self) -> str:
        """The output, or an element of it."""

    @property
    def target(self) -> str:
        """The component of the input."""

    @property
    def input(self) -> str:
        """The input, or an element of it."""


class Drawn(Protocol):
    """A system, as far as it is drawn; `order` is that of execution, of all components or of some."""

    @property
    def components(self) -> Sequence[Named]:
        """What is drawn as rectangles."""

    @property
    def links(self) -> Sequence[Wired]:
        """What is drawn as lines."""

    @property
    def order(self) -> Sequence[str]:
        """Names of components."""


@dataclass(frozen=True)
class _Net:
    """All that one output feeds: its component and its field."""

    source: str
    output: str


@dataclass(frozen=True)
class _Wire:
    """What is drawn as one connection: the fields that a link connects, or whose elements it does."""

    net: _Net
    target: str
    input: str


class Diagram:
    """The drawing of `system`, whose components have connectors for the inputs and outputs `shown` by component.

    Above its connectors a component has room for so many lines of `headings`, those that it has by name.
    `boxes` are the components' rectangles by name, and `canvas` is the rectangle around all.
    """

    def __init__(
        self,
        system: Drawn,
        shown: Mapping[str, tuple[Sequence[str], Sequence[str]]],
        headings: Mapping[str, Sequence[str]] | None = None,
    ) -> None:
        self._headings = headings or {}
        names = [component.name for component in system.components]
        order = [*system.order, *(name for name in names if name not in system.order)]
        self._pins = {
            (name, kind): list(dict.fromkeys(map(_field, fields)))
            for name in names
            for kind, fields in zip(("input", "output"), shown[name], strict=True)
        }
        wires = list(dict.fromkeys(map(_wire, system.links)))
        self._column = _columns(order, wires)
        columns = [[name for name in order if self._column[name] == number] for number in range(_count(self._column))]
        self._tracks = _tracks(wires, self._column)
        self._lanes = _lanes(wires, self._column)
        self._place(columns)

    def pin(self, component: str, kind: str, name: str) -> Point:
        """The place of the connector of an input or output: from (0, 0), lower left, to (1, 1), upper right."""
        box = self.boxes[component]
        height = (self._height(component, kind, _field(name)) - box.bottom) / (box.top - box.bottom)
        return (0.0 if kind == "input" else 1.0, round(height, 6))

    def way(self, link: Wired) -> tuple[Point, ...]:
        """The points at which the drawing of `link` turns, from its output to its input."""
        wire = _wire(link)
        begin = self._height(wire.net.source, "output", wire.net.output)
        end = self._height(wire.target, "input", wire.input)
        leaving = self._x(self._column[wire.net.source] + 1, wire.net)
        if not _is_far(wire, self._column):
            return ((leaving, begin), (leaving, end))
        arriving, lane = self._x(self._column[wire.target], wire), self._lane(wire)
        return ((leaving, begin), (leaving, lane), (arriving, lane), (arriving, end))

    def _place(self, columns: Sequence[Sequence[str]]) -> None:
        """Place the columns beside each other, and what is in each below each other, all in the middle."""
        heights = {name: self._rows(name) * PITCH for column in columns for name in column}
        totals = [sum(heights[name] for name in column) + _GAP * (len(column) - 1) for column in columns]
        below = sum(1 for backwards in self._lanes.values() if "below" in backwards)
        above = sum(1 for forwards in self._lanes.values() if "above" in forwards)
        self._bottom = _GAP + below * PITCH
        tallest = max(totals, default=0.0)
        self._top = self._bottom + tallest
        self.boxes: dict[str, Box] = {}
        self._left: list[float] = []
        x = _GAP
        for number, (column, total) in enumerate(zip(columns, totals, strict=True)):
            self._left.append(x)
            x += (len(self._tracks[number]) + 1) * PITCH
            # Whole pitches, so that inputs and outputs keep apart: see `_height`.
            y = self._top - (tallest - total) // (2.0 * PITCH) * PITCH
            width = max(self._width(name) for name in column)
            for name in column:
                self.boxes[name] = Box(x, y - heights[name], x + width, y)
                y -= heights[name] + _GAP
            x += width
        self._left.append(x)
        x += (len(self._tracks[len(columns)]) + 1) * PITCH
        self.canvas = Box(0.0, 0.0, x + _GAP, self._top + above * PITCH + _GAP)

    def _rows(self, component: str) -> int:
        """Height of a component in pitches: a row for each connector, and one for its name."""
        return max(len(self._pins[component, kind]) for kind in ("input", "output")) + 2 + self._lines(component)

    def _lines(self, component: str) -> int:
        return len(self._headings.get(component, ()))

    def _width(self, component: str) -> float:
        longest = sum(max(map(len, self._pins[component, kind]), default=0) for kind in ("input", "output"))
        heading = max(map(len, self._headings.get(component, ())), default=0)
        letters = max(longest + 4, len(component) + 4, heading + 4, 12)
        return letters * _LETTER

    def _height(self, component: str, kind: str, field: str) -> float:
        """The y of a connector. Outputs are half a pitch lower than inputs, so that their connections keep apart."""
        row = self._pins[component, kind].index(field) + (1.5 if kind == "output" else 1.0) + self._lines(component)
        return self.boxes[component].top - row * PITCH

    def _x(self, gap: int, track: _Net | _Wire) -> float:
        """The x of a track in the gap to the left of a column."""
        return self._left[gap] + (self._tracks[gap].index(track) + 1) * PITCH

    def _lane(self, wire: _Wire) -> float:
        """The y of a lane above or below all components."""
        side = _side(wire, self._column)
        number = [net for net, sides in self._lanes.items() if side in sides].index(wire.net) + 1
        return self._top + number * PITCH if side == "above" else self._bottom - number * PITCH


def _field(name: str) -> str:
    """The field that a variable may be an element of: `potential[7]` is one of `potential`."""
    return name.partition("[")[0] if name.endswith("]") else name


def _wire(link: Wired) -> _Wire:
    return _Wire(_Net(link.source, _field(link.output)), link.target, _field(link.input))


def _columns(order: Sequence[str], wires: Iterable[_Wire]) -> dict[str, int]:
    """The number of the column of each component: behind all that feed it and come before it in the `order`."""
    wires = list(wires)
    columns: dict[str, int] = {}
    for name in order:
        before = [columns[wire.net.source] for wire in wires if wire.target == name and wire.net.source in columns]
        columns[name] = max(before, default=-1) + 1
    return columns


def _count(columns: Mapping[str, int]) -> int:
    return max(columns.values(), default=-1) + 1


def _is_far(wire: _Wire, columns: Mapping[str, int]) -> bool:
    """Whether the target is not in the very next column."""
    return columns[wire.target] != columns[wire.net.source] + 1


def _side(wire: _Wire, columns: Mapping[str, int]) -> str:
    return "above" if columns[wire.target] > columns[wire.net.source] else "below"


def _tracks(wires: Iterable[_Wire], columns: Mapping[str, int]) -> list[list[_Net | _Wire]]:
    """The tracks in each gap: of outputs that leave the column before it, and of what arrives from a lane."""
    tracks: list[dict[_Net | _Wire, None]] = [{} for _ in range(_count(columns) + 1)]
    for wire in wires:
        tracks[columns[wire.net.source] + 1][wire.net] = None
        if _is_far(wire, columns):
            tracks[columns[wire.target]][wire] = None
    return [list(gap) for gap in tracks]


def _lanes(wires: Iterable[_Wire], columns: Mapping[str, int]) -> dict[_Net, set[str]]:
    """The outputs that need lanes, and on which sides."""
    lanes: dict[_Net, set[str]] = {}
    for wire in wires:
        if _is_far(wire, columns):
            lanes.setdefault(wire.net, set()).add(_side(wire, columns))
    return lanes
