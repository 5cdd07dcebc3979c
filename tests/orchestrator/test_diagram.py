"""If these fail, a tool that opens a package draws components on each other, or connections through them."""

from itertools import combinations, pairwise
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.ssp.export.diagram import Box, Diagram, Point
from cardiac_cosim.orchestrator.systems.system import Component, Link, System
from hypothesis import given, settings
from hypothesis import strategies as st

Segment = tuple[Point, Point]


def _system(names: list[str], feeds: list[tuple[str, str, str]], order: list[str] | None = None) -> System:
    """Components with the outputs x and y, each of which may feed the input of any other that is called after both."""
    links = tuple(Link(source, output, target, f"{source}_{output}") for source, output, target in feeds)
    parts = tuple(
        Component(name, Path("none.fmu"), {link.input: () for link in links if link.target == name}, {"x": (), "y": ()})
        for name in names
    )
    return System("drawn", parts, links, 1.0, 0.1, tuple(order or ()))


def _diagram(system: System) -> Diagram:
    return Diagram(system, {part.name: (list(part.inputs), list(part.outputs)) for part in system.components})


def _end(diagram: Diagram, component: str, kind: str, name: str) -> Point:
    box, (x, y) = diagram.boxes[component], diagram.pin(component, kind, name)
    return (box.left + x * (box.right - box.left), box.bottom + y * (box.top - box.bottom))


def _segments(diagram: Diagram, link: Link) -> list[Segment]:
    start = _end(diagram, link.source, "output", link.output)
    points = [start, *diagram.way(link), _end(diagram, link.target, "input", link.input)]
    return list(pairwise(points))


def _extent(segment: Segment) -> Box:
    (x1, y1), (x2, y2) = segment
    return Box(min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2))


def _overlap(one: Box, other: Box, margin: float = 1e-3) -> bool:
    """Whether the insides overlap; ends that touch do not."""
    return (
        one.left < other.right - margin
        and other.left < one.right - margin
        and one.bottom < other.top - margin
        and other.bottom < one.top - margin
    )


def _check(system: System) -> None:
    diagram = _diagram(system)
    for one, other in combinations(diagram.boxes.values(), 2):
        assert not _overlap(one, other)
    for box in diagram.boxes.values():
        assert box.left < box.right
        assert box.bottom < box.top
        assert diagram.canvas.left < box.left < box.right < diagram.canvas.right
        assert diagram.canvas.bottom < box.bottom < box.top < diagram.canvas.top
    drawn = {link: _segments(diagram, link) for link in system.links}
    for segments in drawn.values():
        for (x1, y1), (x2, y2) in segments:
            assert abs(x1 - x2) < 1e-3 or abs(y1 - y2) < 1e-3
            assert 0.0 < min(x1, x2) <= max(x1, x2) < diagram.canvas.right
            assert 0.0 < min(y1, y2) <= max(y1, y2) < diagram.canvas.top
    for segments in drawn.values():
        for segment in segments:
            # Half a millimetre around it, so that a line has an inside.
            line = _extent(segment)
            for box in diagram.boxes.values():
                assert not _overlap(Box(line.left, line.bottom - 0.5, line.right, line.top + 0.5), box)
    for one, other in combinations(system.links, 2):
        if (one.source, one.output) == (other.source, other.output):
            continue
        for mine in map(_extent, drawn[one]):
            for theirs in map(_extent, drawn[other]):
                flat = [each.top - each.bottom < 1e-3 for each in (mine, theirs)]
                if flat == [True, True] and abs(mine.top - theirs.top) < 1e-3:
                    assert mine.right < theirs.left + 1e-3 or theirs.right < mine.left + 1e-3
                if flat == [False, False] and abs(mine.left - theirs.left) < 1e-3:
                    assert mine.top < theirs.bottom + 1e-3 or theirs.top < mine.bottom + 1e-3


def test_a_loop_stands_in_the_order_of_execution() -> None:
    feeds = [("fibers", "x", "heart"), ("fibers", "y", "wall"), ("heart", "x", "stress"), ("stress", "x", "wall")]
    feeds.append(("wall", "x", "heart"))
    names = ["fibers", "heart", "stress", "wall"]
    system = _system(names, feeds)
    _check(system)
    boxes = _diagram(system).boxes
    assert sorted(names, key=lambda name: boxes[name].left) == names
    # The same loop, begun at another place.
    order = ["fibers", "wall", "heart", "stress"]
    boxes = _diagram(_system(names, feeds, order)).boxes
    assert boxes["wall"].left < boxes["heart"].left < boxes["stress"].left


def test_what_nothing_orders_stands_one_below_the_other() -> None:
    boxes = list(_diagram(_system(["a", "b", "c"], [])).boxes.values())
    assert len({box.left for box in boxes}) == 1
    assert boxes[0].bottom > boxes[1].top > boxes[1].bottom > boxes[2].top


def test_elements_of_a_field_are_one_connector() -> None:
    links = tuple(Link("a", f"u[{place}]", "b", f"v[{place}]") for place in range(1, 4))
    outputs = dict.fromkeys(("u[1]", "u[2]", "u[3]", "w"), ())
    parts = (
        Component("a", Path("none.fmu"), {}, outputs),
        Component("b", Path("none.fmu"), dict.fromkeys(("v[1]", "v[2]", "v[3]"), ()), {}),
    )
    diagram = _diagram(System("s", parts, links, 1.0, 0.1))
    assert len({diagram.way(link) for link in links}) == 1
    assert diagram.pin("a", "output", "u[1]") == diagram.pin("a", "output", "u[3]") != diagram.pin("a", "output", "w")


_NAMES = ["a", "b", "c", "d", "e", "f"]


@pytest.mark.parametrize("with_itself", [False, True])
def test_nothing_overlaps(with_itself: bool) -> None:
    feed = st.tuples(st.sampled_from(_NAMES), st.sampled_from("xy"), st.sampled_from(_NAMES))
    feeds = st.lists(feed.filter(lambda each: with_itself or each[0] != each[2]), max_size=14, unique=True)

    @settings(max_examples=150, derandomize=True, database=None, deadline=None)
    @given(feeds, st.permutations(_NAMES))
    def check(chosen: list[tuple[str, str, str]], order: list[str]) -> None:
        _check(_system(_NAMES, chosen, order))

    check()
