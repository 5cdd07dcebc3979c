"""Where the tissue is stimulated: the potential at the start of the run."""

from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ...orchestrator.results.stored_run import StoredRun
from .layout import BAR_IN, TEXT_PT, TITLE_PT, color_bar, panels
from .scene import add_scale_bar, show
from .skin import Skin
from .viewpoints import ABOVE, TILTED

# Part of the tissue up to which an excited part of it is a place where a wave begins.
_PLACE = 0.5


def stimulus(run: StoredRun) -> Figure | None:
    """The potential at 0 ms from obliquely above and straight down; None where it is the same everywhere or unknown."""
    mesh, potential = run.mesh, run.frame("potential_mV", 0)
    if mesh is None or potential is None or potential.shape != (mesh.nodes,) or run.frames_ms[0] != 0.0:
        return None
    low, high = float(potential.min()), float(potential.max())
    excited = potential > 0.5 * (low + high)
    if not low < high or excited.mean() > _PLACE:
        return None
    skin = Skin(mesh)
    colors = ScalarMappable(Normalize(low, high), "plasma")
    scenes = {"from the front and above": TILTED, "straight down on the base": ABOVE}
    windows = [skin.window(view) for view in scenes.values()]
    windows = [window.as_large_as(windows) for window in windows]
    shown = panels(2, 2, windows[0].aspect, below_in=BAR_IN + 0.2)
    for axis, (title, view), window in zip(shown.axes, scenes.items(), windows, strict=True):
        show(axis, view, [[skin.painted(view, potential, colors), skin.edges(view, on_dark=True)]], window)
        axis.set_title(title, fontsize=TITLE_PT)
    first, last = mesh.points[excited].min(axis=0), mesh.points[excited].max(axis=0)
    # Straight down, what is right and up on the picture is X and Y.
    box = Rectangle((first[0], first[1]), *(last - first)[:2], fill=False, linestyle="--", linewidth=1.5, zorder=9)
    shown.axes[1].add_patch(box)
    add_scale_bar(shown.axes[0], TILTED, windows[0])
    color_bar(shown, colors, "transmembrane potential at 0 ms (mV)")
    spans = ", ".join(_span(name, a, b) for name, a, b in zip("XYZ", first.round(1), last.round(1), strict=True))
    shown.figure.supxlabel(
        f"{high:g} mV at {int(excited.sum())} of {mesh.nodes} nodes: {spans} mm (dashed)".replace("-", "−"),
        fontsize=TEXT_PT,
    )
    return shown.figure


def _span(name: str, first: float, last: float) -> str:
    # What is added makes a zero of a negative one.
    return f"{name} {first + 0.0:g}" if first == last else f"{name} {first + 0.0:g} to {last + 0.0:g}"
