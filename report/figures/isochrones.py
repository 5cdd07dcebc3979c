"""Bands of activation times, of a round number of milliseconds each, and their colours."""

from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap

from ...orchestrator.participants.participant import Values

# Lengths of a band in ms, and the number of bands that is not exceeded.
_BANDS_MS = tuple(base * 10.0**power for power in range(-1, 4) for base in (1.0, 2.0, 5.0))
_MOST = 15

#: Red, green and blue of tissue that was not activated.
NOT_ACTIVATED = (0.85, 0.85, 0.85)


@dataclass(frozen=True)
class Isochrones:
    """The ends of the bands in ms: one more than there are bands."""

    levels_ms: tuple[float, ...]

    @property
    def inner(self) -> tuple[float, ...]:
        """Those between two bands, where lines are drawn."""
        return self.levels_ms[1:-1]

    @property
    def colors(self) -> ScalarMappable:
        """Early is dark, late is bright; tissue without a time is grey."""
        bands = len(self.levels_ms) - 1
        palette = ListedColormap(colormaps["viridis"](np.linspace(0.0, 1.0, bands)))
        norm = BoundaryNorm(self.levels_ms, bands)
        # What the norm does not know lies above all bands for it.
        return ScalarMappable(norm, palette.with_extremes(over=NOT_ACTIVATED, bad=NOT_ACTIVATED))

    @property
    def ticks(self) -> tuple[float, ...]:
        """Ends of bands that are labelled: all, or of many every second one."""
        return self.levels_ms[:: 1 if len(self.levels_ms) <= _MOST // 2 else 2]


def isochrones(times_ms: Values) -> Isochrones | None:
    """Bands for activation times with gaps, which are NaN; None where nothing was activated at different times."""
    known = times_ms[np.isfinite(times_ms)]
    if not len(known) or known.min() == known.max():
        return None
    low, high = float(known.min()), float(known.max())
    width = next((width for width in _BANDS_MS if high - low <= (_MOST - 1) * width), _BANDS_MS[-1])
    first, last = int(np.floor(low / width)), int(np.floor(high / width)) + 1
    return Isochrones(tuple(width * number for number in range(first, last + 1)))
