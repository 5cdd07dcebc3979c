"""What is seen of a body, whole and cut open: all of the page that does not change while a run goes on."""

from dataclasses import dataclass

import numpy as np

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from ..figures.surface import Numbers
from .cutaway import Cutaway, cut, whole
from .fiber_marks import FiberMarks, fiber_marks
from .shape import Shape, shape_of

#: Cuts by what a person is told, and the direction of what they take off.
_CUTS = (
    ("front cut away (−y)", (0.0, -1.0, 0.0)),
    ("side cut away (+x)", (1.0, 0.0, 0.0)),
    ("top cut away (+z)", (0.0, 0.0, 1.0)),
)

#: Parts of the extent that are taken off, and the number of the one that is shown first.
_DEPTHS, FIRST_DEPTH = (0.2, 0.35, 0.5, 0.65, 0.8), 2


@dataclass(frozen=True)
class View:
    """A cutaway with its edges by vertices, shape (n, 2), and marks of the fibres, where there are fibres."""

    drawn: Cutaway
    edges: Numbers
    marks: FiberMarks | None


@dataclass(frozen=True)
class Views:
    """All views of a shape: the whole one, and those of each cut from shallow to deep, by its title."""

    shape: Shape
    whole: View
    cuts: dict[str, list[View]]


def views_of(run: StoredRun) -> Views | None:
    """The views of a run's body, as soon as the fields are there that do not change; None where there is no body."""
    shape = shape_of(run)
    if shape is None:
        return None
    fiber = run.initial("fiber")
    if shape.is_strand or fiber is None or fiber.shape != (len(shape.cells), 3):
        fiber = None
    cuts = {}
    for title, direction in _CUTS if shape.is_solid else ():
        away = np.array(direction)
        along = shape.points @ away
        depths = along.max() - np.array(_DEPTHS) * np.ptp(along)
        cuts[title] = [_view(shape, cut(shape, away, float(depth)), fiber) for depth in depths]
    return Views(shape, _view(shape, whole(shape), fiber), cuts)


def _view(shape: Shape, drawn: Cutaway, fiber: Values | None) -> View:
    # A tube has edges only because it is drawn with few sides.
    edges = np.empty((0, 2), dtype=np.int64) if shape.is_strand else drawn.edges(shape.points)
    return View(drawn, edges, None if fiber is None else fiber_marks(shape, drawn, fiber))
