"""Where the probes of a run are, on its pictures."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from ...orchestrator.participants.participant import Values
from ...orchestrator.results.stored_run import StoredRun
from .layout import TEXT_PT

#: A white rim around letters.
RIM = withStroke(linewidth=3, foreground="white")


def probes(run: StoredRun) -> dict[str, Values]:
    """The places of the probes in mm, shape (3,), by name; empty for a run whose summary has none."""
    scenario = run.summary.get("scenario")
    output = scenario.get("output") if isinstance(scenario, dict) else None
    places = output.get("probes_mm") if isinstance(output, dict) else None
    return {name: np.array(place, dtype=float) for name, place in places.items()} if isinstance(places, dict) else {}


def mark(axis: Axes, places: Mapping[str, tuple[float, float]]) -> None:
    """A dot with a name at each place on an axis; white rims set them off from whatever is behind.

    Names stand above and below their dots in turn, so that those of neighbours keep apart.
    """
    for number, (name, (x, y)) in enumerate(places.items()):
        axis.plot(x, y, "o", color="black", markeredgecolor="white", markersize=7, zorder=11, clip_on=False)
        axis.annotate(
            name.replace("_", " "),
            (x, y),
            (6, 4 if number % 2 == 0 else -13),
            textcoords="offset points",
            fontsize=TEXT_PT,
            path_effects=[RIM],
            zorder=11,
        )
