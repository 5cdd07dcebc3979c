"""A body of tetrahedra as it is drawn: its skin, the skin's edges, and the face of a cut, in any view and motion."""

from collections.abc import Sequence

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body
from .scene import Painted, View, Window, pen, shaded, strokes
from .surface import Numbers, divided, normals, section, sharp_edges, smoothing, surface

# Width of lines of equal value, and how far they are lifted off what they lie on, relative to the size of the body.
_LINE, _LIFT = 1 / 300, 1 / 50

# Brightness of edges that must be seen on dark colours too.
_ON_DARK = 0.5


def evenly(*rgb: tuple[float, float, float]) -> ScalarMappable:
    """The colours of the numbers 0, 1, 2 and so on: of parts that are only told apart."""
    return ScalarMappable(Normalize(-0.5, len(rgb) - 0.5), ListedColormap(list(rgb)))


class Skin:
    """What is the same in every picture of `mesh`.

    Which parts are smooth is decided on the undeformed body: wrinkles that come with motion are no edges.

    Attributes
    ----------
    faces, element:
        The surface's faces, normals outward, shape (faces, 3), and the element that each belongs to, shape (faces,).
    normals:
        Of the faces of the undeformed body, shape (faces, 3).
    size_mm:
        The longest side of the box around the body.
    """

    def __init__(self, mesh: Body) -> None:
        self.mesh = mesh
        self.faces, self.element = surface(mesh.cells)
        self.normals = normals(mesh.points, self.faces)
        self.size_mm = float(np.ptp(mesh.points, axis=0).max())
        self._smooth = smoothing(mesh.points, self.faces)
        self._edges = sharp_edges(mesh.points, self.faces)

    def window(self, view: View) -> Window:
        """What the undeformed body takes in a picture, the rim of the cut included."""
        rim, _ = section(self.mesh.points, self.faces, view.beyond(self.mesh.points))
        return view.window(np.concatenate([self.mesh.points, rim.reshape(-1, 3)]))

    def spread(self, of_elements: Values) -> Values:
        """Values of elements, shape (elements,), at the corners of the faces, smoothed; shape (faces, 3)."""
        return np.asarray((self._smooth @ of_elements[self.element]).reshape(-1, 3))

    def places(self, boundary: Numbers) -> Numbers:
        """The numbers of those faces that a boundary consists of, given by its own faces, shape (any, 3)."""
        order = np.array([self.mesh.nodes**2, self.mesh.nodes, 1])
        if boundary.ndim != 2 or boundary.shape[1] != len(order):
            return np.empty(0, dtype=np.int64)
        return np.flatnonzero(np.isin(np.sort(self.faces, axis=1) @ order, np.sort(boundary, axis=1) @ order))

    def corner_normals(self, points: Values | None = None) -> Values:
        """Outward normals at the corners of the faces, smoothed, shape (faces, 3, 3); see `painted` for `points`."""
        own = self.normals if points is None else normals(points, self.faces)
        return np.asarray((self._smooth @ own).reshape(-1, 3, 3))

    def painted(
        self,
        view: View,
        values: Values,
        colors: ScalarMappable,
        *,
        points: Values | None = None,
        white: float = 0.0,
        levels: Sequence[float] = (),
    ) -> Painted:
        """The skin by `values` at the nodes, shape (nodes,), or at the faces' corners, shape (faces, 3); see `shaded`.

        `points` are where the nodes have moved to, in mm.
        """
        corners = (self.mesh.points if points is None else points)[self.faces]
        at_corners = values[self.faces] if values.ndim == 1 else values
        return shaded(view, corners, at_corners, self.corner_normals(points), colors, white, levels)

    def edges(self, view: View, points: Values | None = None, *, on_dark: bool = False) -> Painted:
        """The sharp edges; `points` are where the nodes have moved to, in mm.

        With `on_dark` they are seen on the dark end of a colour bar as well as on the bright one.
        """
        lines = (self.mesh.points if points is None else points)[self._edges]
        return pen(view, lines, self.size_mm, *([_ON_DARK] if on_dark else []))

    def cut(
        self, view: View, values: Values, colors: ScalarMappable, levels: Sequence[float] = ()
    ) -> tuple[list[Painted], list[Painted]]:
        """The face of the cut by `values` of the nodes, or evenly in each element by values of the elements; its rim.

        What is left of the body never hides them: they are layers of their own, over all else.
        """
        points, cells, height = self.mesh.points, self.mesh.cells, view.beyond(self.mesh.points)
        rim = [pen(view, section(points, self.faces, height)[0], self.size_mm)]
        if len(values) != self.mesh.nodes:
            triangles, element = section(points, cells, height)
            return [Painted(triangles, colors.to_rgba(values[element])[:, :3])], rim
        triangles, _ = section(np.column_stack([points, values]), cells, height)
        triangles = divided(triangles, 3, levels)
        return [Painted(triangles[..., :3], colors.to_rgba(triangles[..., 3].mean(axis=1))[:, :3])], rim

    def lines(self, view: View, values: Values, levels: Sequence[float]) -> tuple[Painted, Painted]:
        """Lines where `values` of the nodes have one of the `levels`: those on the skin, and on the face of the cut."""
        points = np.column_stack([self.mesh.points, values])
        # Where a value is missing, so are the lines.
        known = np.isfinite(values)
        toward_eye = self.faces[(self.normals @ view.axes[2] > 0.0) & known[self.faces].all(axis=1)]
        cells = self.mesh.cells[known[self.mesh.cells].all(axis=1)]
        cut, _ = section(points, cells, view.beyond(self.mesh.points))
        on_cut, corners = cut.reshape(-1, 4), np.arange(3 * len(cut)).reshape(-1, 3)
        drawn = []
        for nodes, triangles in ((points, toward_eye), (on_cut, corners)):
            found = [section(nodes[:, :3], triangles, nodes[:, 3] - level)[0] for level in levels]
            lines = np.concatenate([np.empty((0, 2, 3)), *found])
            black = np.zeros((len(lines), 3))
            drawn.append(strokes(view, lines, black, _LINE * self.size_mm, _LIFT * self.size_mm))
        return drawn[0], drawn[1]
