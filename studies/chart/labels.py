"""Labels beside the points of a panel, where there is room for them."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from ..pictures.lettering import POINTS, plain, width_in

SIZE = 8.0

#: Half the side of a marker and half the width of a line, with some air, and the distance of a label from its marker.
_MARKER, _LINE, _AWAY = 4.0, 1.2, 5.5

#: Panels with more points than this have no labels: they would say nothing in such a crowd.
_MOST = 80

#: Letters are thin, so that they need colours darker than those of lines, by this factor.
_INK = 0.7

#: Where a label stands beside its point, the best first: to the right and left of lines that fall to the right.
_SIDES = ((1, 1), (-1, -1), (1, 0), (0, 1), (0, -1), (-1, 0), (1, -1), (-1, 1))

_ALIGNMENTS = {-1: ("right", "top"), 0: ("center", "center"), 1: ("left", "bottom")}

Boxes = NDArray[np.float64]


@dataclass(frozen=True)
class Label:
    """`text` for a point at `place`, in the units of the axes."""

    text: str
    place: tuple[float, float]
    color: str


def put_labels(
    axis: Axes, labels: Sequence[Label], markers: Sequence[tuple[float, float]], lines: Sequence[Boxes]
) -> None:
    """Write the labels beside their points, without covering markers, lines (corners, shape (n, 2)) or each other.

    The limits of `axis` must be final. A label without room is left out.
    """
    if len(markers) > _MOST:
        return
    scale = POINTS / axis.figure.dpi
    rim = _points(axis.transAxes.transform([(0.0, 0.0), (1.0, 1.0)]), scale).ravel()
    taken = [_around(_points(axis.transData.transform(np.array(markers, dtype=float)), scale), _MARKER)]
    for corners in lines:
        taken.append(_around(_between(_points(axis.transData.transform(corners), scale)), _LINE))
    boxes = np.concatenate(taken)
    for label in labels:
        x, y = _points(axis.transData.transform([label.place]), scale)[0]
        width, height = width_in(label.text, SIZE) * POINTS, SIZE
        for right, above in _SIDES:
            away = _AWAY if right == 0 or above == 0 else 0.6 * _AWAY
            left = x + right * away + (right - 1) * 0.5 * width
            bottom = y + above * away + (above - 1) * 0.5 * height
            box = np.array([left, bottom, left + width, bottom + height])
            if _is_inside(box, rim) and not _overlap(box, boxes):
                horizontal, vertical = _ALIGNMENTS[right][0], _ALIGNMENTS[above][1]
                axis.annotate(
                    plain(label.text),
                    label.place,
                    (right * away, above * away),
                    textcoords="offset points",
                    ha=horizontal,
                    va=vertical if above else "center_baseline",
                    fontsize=SIZE,
                    color=tuple(_INK * part for part in to_rgb(label.color)),
                    path_effects=[withStroke(linewidth=2.0, foreground="white")],
                )
                boxes = np.vstack([boxes, box])
                break


def _points(pixels: Boxes, scale: float) -> Boxes:
    return np.asarray(pixels, dtype=float) * scale


def _around(places: Boxes, half: float) -> Boxes:
    return np.hstack([places - half, places + half])


def _between(corners: Boxes) -> Boxes:
    """Places along a line through `corners`, closer to each other than a label is high."""
    pieces = [corners[:1]]
    for begin, end in pairwise(corners):
        count = int(np.clip(np.hypot(*(end - begin)) / 3.0, 1, 400)) + 1
        pieces.append(begin + (end - begin) * np.linspace(0.0, 1.0, count)[:, None])
    return np.concatenate(pieces)


def _is_inside(box: Boxes, rim: Boxes) -> bool:
    return bool((box[:2] >= rim[:2] + 1.0).all() and (box[2:] <= rim[2:] - 1.0).all())


def _overlap(box: Boxes, boxes: Boxes) -> bool:
    return bool(((boxes[:, :2] < box[2:]) & (boxes[:, 2:] > box[:2])).all(axis=1).any())
