"""A field of the nodes on a solid in several frames, in one array of pictures."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import Body, StoredRun
from .frames import Frame
from .layout import BAR_IN, COLUMNS, TEXT_PT, color_bar, panels, wrapped
from .scene import Painted, add_scale_bar, show
from .skin import Skin
from .viewpoints import TILTED

_GHOST = 0.88

# Of the steps to whose ends colour bars are rounded.
_HAIR = 0.05


class FieldOfFrames(NamedTuple):
    """What is shown: the frames, the field in each, shape (nodes,), its name and unit of measure, and its colours.

    The colour bar ends at multiples of `round_to`. `undeformed` is whether that shape is shown behind what has moved.
    """

    frames: Sequence[Frame]
    values: Sequence[Values]
    label: str
    palette: str
    round_to: float
    undeformed: bool = True

    @property
    def colors(self) -> ScalarMappable:
        """The colours of all frames."""
        # A hair beyond a round number must not cost a whole step of the colour bar.
        low = np.floor(np.min(self.values) / self.round_to + _HAIR)
        high = np.ceil(np.max(self.values) / self.round_to - _HAIR)
        # A body at rest has one value; the colour bar still needs two ends.
        return ScalarMappable(Normalize(self.round_to * low, self.round_to * max(high, low + 1.0)), self.palette)

    @property
    def titles(self) -> list[str]:
        """What stands above the pictures."""
        return [wrapped(frame.title, min(len(self.frames), COLUMNS)) for frame in self.frames]


def solid_snapshots(run: StoredRun, mesh: Body, shown: FieldOfFrames) -> Figure:
    """A panel per frame, on the deformed body where it moves."""
    skin, colors = Skin(mesh), shown.colors
    moved = [run.frame("displacement_mm", frame.number) for frame in shown.frames]
    places = [mesh.points if shift is None else mesh.points + shift for shift in moved]
    deforms = shown.undeformed and any(shift is not None and shift.any() for shift in moved)
    window = TILTED.window(np.concatenate([mesh.points, *places]))
    # The undeformed shape, behind; what faces the eye has its whole outline.
    shape = mesh.points[skin.faces[skin.normals @ TILTED.axes[2] > 0.0]]
    ghost = [[Painted(shape, np.full((len(shape), 3), _GHOST))]] if deforms else []
    lines = max(title.count("\n") + 1 for title in shown.titles)
    array = panels(
        len(shown.frames), COLUMNS, window.aspect, title_lines=lines, below_in=BAR_IN + 0.25 * deforms, square=True
    )
    for axis, title, points, values in zip(array.axes, shown.titles, places, shown.values, strict=True):
        body = [skin.painted(TILTED, values, colors, points=points), skin.edges(TILTED, points, on_dark=True)]
        show(axis, TILTED, [*ghost, body], window)
        axis.set_title(title, fontsize=TEXT_PT)
    add_scale_bar(array.axes[0], TILTED, window)
    color_bar(array, colors, shown.label)
    if deforms:
        array.figure.supxlabel("pale grey: the undeformed shape", fontsize=TEXT_PT)
    return array.figure
