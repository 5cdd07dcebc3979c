"""The named boundaries of a body: what is in contact with the epicardium, the endocardia, and where the base is."""

import math
from collections.abc import Mapping

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .layout import LEGEND_IN, TITLE_PT, legend, panels
from .scene import Painted, View, add_scale_bar, show
from .skin import Skin, evenly
from .surface import Numbers
from .viewpoints import TILTED, facing, long_axis

# What is no part of a boundary, on the skin and on the face of a cut; and the boundaries of one panel, which differ in
# brightness too.
_REST, _PALE = (0.88, 0.88, 0.88), evenly((0.97, 0.97, 0.97))
_TONES = ((0.05, 0.27, 0.49), (0.85, 0.45, 0.25), (0.96, 0.83, 0.45), (0.10, 0.36, 0.33), (0.55, 0.35, 0.60))

# From so far to the right of the front one sees into both cavities, the septum's right side included, in degrees.
_INTO = 30.0

# Part of its area by which a boundary has to look one way to be seen whole from there.
_FLAT = 0.5


def boundaries(run: StoredRun) -> Figure | None:
    """A panel for the epicardium, the endocardia and the base each; None for a body without named boundaries."""
    mesh = run.mesh
    if mesh is None:
        return None
    skin = Skin(mesh)
    found = {name: faces for name, numbers in run.boundaries.items() if len(faces := skin.places(numbers))}
    if not found:
        return None
    groups = _groups(found)
    scenes = [_view(skin, np.concatenate([found[name] for name in names])) for names in groups.values()]
    windows = [skin.window(view) for view in scenes]
    windows = [window.as_large_as(windows) for window in windows]
    names = [name for group in groups.values() for name in group]
    tones = dict(zip(names, (_TONES[number % len(_TONES)] for number in range(len(names))), strict=True))
    columns = min(len(groups), 3)
    shown = panels(
        len(groups), columns, windows[0].aspect, title_lines=2, below_in=LEGEND_IN * -(-len(names) // 3), square=True
    )
    for axis, (title, group), view, window in zip(shown.axes, groups.items(), scenes, windows, strict=True):
        values, colors = _categories(len(skin.faces), {name: found[name] for name in group}, tones)
        layers: list[list[Painted]] = [[skin.painted(view, values, colors), skin.edges(view)]]
        if math.isfinite(view.cut_mm):
            layers += skin.cut(view, np.zeros(mesh.elements), _PALE)
            title = f"{title}\n(front half cut away)"
        show(axis, view, layers, window)
        axis.set_title(title, fontsize=TITLE_PT)
    add_scale_bar(shown.axes[0], scenes[0], windows[0])
    legend(shown, {name.replace("_", " ").replace("lv", "LV").replace("rv", "RV"): tones[name] for name in names})
    return shown.figure


def _groups(found: Mapping[str, Numbers]) -> dict[str, list[str]]:
    """The boundaries of each panel by its title: the outer surface, the inner ones with the septum, then each other."""
    inner = sorted(name for name in found if "endocardium" in name or "septum" in name)
    groups = {"epicardium": [name for name in found if name == "epicardium"]}
    groups["endocardium" if len(inner) == 1 else "endocardia"] = inner
    for name in sorted(set(found) - {*inner, "epicardium"}):
        groups[name] = [name]
    return {title: names for title, names in groups.items() if names}


def _view(skin: Skin, faces: Numbers) -> View:
    """From where these faces are seen: a hollow one needs a cut, a flat one on top a look from above."""
    areas = _areas(skin, faces)
    mean = areas.sum(axis=0) / np.linalg.norm(areas, axis=1).sum()
    if mean[2] > _FLAT:
        return TILTED
    if np.linalg.norm(mean[:2]) > _FLAT:
        return facing(areas)
    centres = skin.mesh.points[skin.faces[faces]].mean(axis=1)
    outward = np.einsum("ni,ni->n", areas, centres - centres.mean(axis=0)).sum() > 0.0
    return facing(areas) if outward else long_axis(skin.mesh.points, _INTO, 20.0)


def _areas(skin: Skin, faces: Numbers) -> Values:
    """Normals as long as the faces are large, shape (faces, 3)."""
    corners = skin.mesh.points[skin.faces[faces]]
    return np.asarray(0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _categories(
    count: int, found: Mapping[str, Numbers], tones: Mapping[str, tuple[float, float, float]]
) -> tuple[Values, ScalarMappable]:
    """A number for each corner of the `count` faces, shape (faces, 3), and the colours of these numbers."""
    values = np.zeros((count, 3))
    for number, faces in enumerate(found.values(), start=1):
        values[faces] = number
    return values, evenly(_REST, *(tones[name] for name in found))
