"""All that the page's program needs to show a body in three dimensions that moves."""

from typing import Any

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .colorings import colorings
from .packed import Packed
from .shape import Shape
from .views import FIRST_DEPTH, View, Views

#: Numbers of all frames together that a page holds at most; of longer runs it shows fewer frames.
_MOST_NUMBERS = 6_000_000

_DISPLACEMENT = "displacement_mm"


def heart(run: StoredRun, views: Views, packed: Packed) -> dict[str, Any] | None:
    """The moving body of a run, whose arrays are added to `packed`; None for a run without a frame."""
    if not len(run.frames_ms):
        return None
    shape = views.shape
    first = [run.frame(name, 0) for name in run.moving]
    numbers = len(run.frames_ms) * sum(values.size for values in first if values is not None)
    every = max(1, -(-numbers // _MOST_NUMBERS))
    places = _places(run, shape, every)
    return {
        "times_ms": run.frames_ms[::every].tolist(),
        "every": every,
        "deforms": len(places) > 1,
        "places": packed.add(places, "f4"),
        "node": packed.add(shape.node, "index"),
        "size_mm": shape.size_mm,
        "box_mm": _box(places),
        "flat": shape.is_flat,
        "strand": shape.is_strand,
        "fibers": views.whole.marks is not None,
        "colorings": [each.content(packed) for each in colorings(run, shape, every)],
        "views": [_view(views.whole, packed)],
        "cuts": [
            {"title": title, "views": [_view(each, packed) for each in cuts], "first": FIRST_DEPTH}
            for title, cuts in views.cuts.items()
        ],
    }


def _places(run: StoredRun, shape: Shape, every: int) -> Values:
    """Where the drawn nodes are in mm, shape (frames, nodes, 3); one frame where nothing moves."""
    shift = run.frames(_DISPLACEMENT, every)
    if shift is None or shift.shape[1:] != (shape.nodes, 3) or not shift.any():
        return shape.points[None]
    return np.asarray(shape.points + shift[:, shape.node])


def _view(view: View, packed: Packed) -> dict[str, Any]:
    content = {
        "start": packed.add(view.drawn.start, "index"),
        "end": packed.add(view.drawn.end, "index"),
        "share": packed.add(view.drawn.share, "f4"),
        "triangles": packed.add(view.drawn.triangles, "index"),
        "edges": packed.add(view.edges, "index"),
    }
    if view.marks is not None:
        content["marked"] = packed.add(view.marks.triangle, "index")
        content["weights"] = packed.add(view.marks.weights, "f4")
    return content


def _box(places: Values) -> list[list[float]]:
    """Least and greatest coordinates in all frames, with a little room, shape (3, 2)."""
    low, high = places.min(axis=(0, 1)), places.max(axis=(0, 1))
    room = 0.03 * float((high - low).max())
    return [[float(least - room), float(most + room)] for least, most in zip(low, high, strict=True)]
