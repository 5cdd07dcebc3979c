"""The tissue on its axes, one frame after the other: a solid in projection, a sheet, or the curve along a strand."""

from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.tri import Triangulation

from ...orchestrator.errors import InputError
from ...orchestrator.results.stored_run import Body, StoredRun
from ..figures.plane import frame_plane, sheet_of
from ..figures.scene import add_scale_bar, show
from ..figures.skin import Skin
from ..figures.viewpoints import TILTED
from .field import MovieField


class Stage(Protocol):
    """What is seen of a field on the tissue.

    `has_bar` says whether colours stand for its values, and `has_labels` whether its axes are labelled.
    """

    has_bar: bool
    has_labels: bool

    def draw(self, axis: Axes, frame: int, colors: ScalarMappable) -> None:
        """Draw a frame on empty axes."""


def stage_of(field: MovieField) -> Stage:
    """The one for the scene of the run; InputError for a scene of one place."""
    run = field.run
    if run.mesh is not None:
        return SolidStage(field, run.mesh)
    triangles = sheet_of(run)
    if triangles is not None:
        return SheetStage(field, triangles)
    points = run.points_mm
    if points is None or len(points) < 2:
        raise InputError(
            f"{run.folder}: the scene is a single place, so there is nothing to film; look at its figures instead"
        )
    return StrandStage(field)


class SolidStage:
    """A body of tetrahedra, moved as it was."""

    has_bar, has_labels = True, False

    def __init__(self, field: MovieField, mesh: Body) -> None:
        self._field, self._mesh, self._skin = field, mesh, Skin(mesh)
        places = [mesh.points, *(self._points(frame) for frame in range(len(field.run.frames_ms)))]
        self._window = TILTED.window(np.concatenate(places))

    def draw(self, axis: Axes, frame: int, colors: ScalarMappable) -> None:
        """See Stage."""
        points, skin = self._points(frame), self._skin
        body = [skin.painted(TILTED, self._field.at(frame), colors, points=points), skin.edges(TILTED, points)]
        show(axis, TILTED, [body], self._window)
        add_scale_bar(axis, TILTED, self._window)

    def _points(self, frame: int) -> np.ndarray:
        moved = self._field.run.frame("displacement_mm", frame)
        return self._mesh.points if moved is None else self._mesh.points + moved


class SheetStage:
    """A sheet of triangles."""

    has_bar, has_labels = True, True

    def __init__(self, field: MovieField, triangles: Triangulation) -> None:
        self._field, self._triangles = field, triangles

    def draw(self, axis: Axes, frame: int, colors: ScalarMappable) -> None:
        """See Stage."""
        values = self._field.at(frame)
        if len(values) == len(self._triangles.x):
            axis.tripcolor(self._triangles, values, shading="gouraud", norm=colors.norm, cmap=colors.cmap)
        else:
            axis.tripcolor(self._triangles, facecolors=values, norm=colors.norm, cmap=colors.cmap)
        frame_plane(axis, self._triangles)


class StrandStage:
    """A line of nodes: the field along it."""

    has_bar, has_labels = False, True

    def __init__(self, field: MovieField) -> None:
        self._field = field
        points = _points(field.run)
        cells = field.run.cells
        values = field.at(0)
        # Of a field of the elements each value stands at the middle of its element.
        place = points[:, 0] if len(values) == len(points) or cells is None else points[cells, 0].mean(axis=1)
        self._order = np.argsort(place)
        self._place = place[self._order]

    def draw(self, axis: Axes, frame: int, colors: ScalarMappable) -> None:
        """See Stage."""
        axis.plot(self._place, self._field.at(frame)[self._order], color="black", linewidth=2.0)
        low, high = colors.get_clim()
        axis.set(xlim=(self._place[0], self._place[-1]), ylim=(low - 0.05 * (high - low), high + 0.05 * (high - low)))
        axis.set_xlabel("place along the fibre (mm)")
        axis.set_ylabel(self._field.label)
        axis.grid(color="0.9")


def _points(run: StoredRun) -> np.ndarray:
    if run.points_mm is None:
        raise TypeError("a run without nodes has no stage")
    return run.points_mm
