"""A budget as a figure: a panel per quantity, in its own unit of measure, with a bar per source."""

from math import ceil, isfinite
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from .budget import Budget, Contribution, Quantity
from .sentences import measured

_PANELS_IN_A_ROW = 3

#: Filled against hollow and hatched: the two are told apart without colours too.
_TRUSTED: dict[str, Any] = {"facecolor": "#0072B2", "edgecolor": "black", "linewidth": 0.8}
_NOT_TRUSTED: dict[str, Any] = {"facecolor": "white", "edgecolor": "black", "linewidth": 0.8, "hatch": "////"}

#: Of the longest bar, on the right of which its number stands.
_ROOM = 1.45


def draw_budget(budget: Budget) -> Figure:
    """The magnitudes of all contributions; those that are not trusted are hollow."""
    columns = min(_PANELS_IN_A_ROW, len(budget.quantities))
    rows = ceil(len(budget.quantities) / columns)
    names = [source.name for source in budget.sources]
    height = 1.0 + rows * (1.0 + 0.3 * len(names))
    figure = Figure(figsize=(2.4 + 3.0 * columns, height), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    axes = list(grid.flat)
    for place, (quantity, axis) in enumerate(zip(budget.quantities, axes, strict=False)):
        _panel(quantity, axis)
        axis.set_yticks(range(len(names)), names if place % columns == 0 else [""] * len(names), fontsize=9)
    for axis in axes[len(budget.quantities) :]:
        axis.remove()
    figure.suptitle(f"{budget.name}: numerical error by source (+ the value is too large, − too small)", fontsize=12)
    figure.legend(
        handles=[
            Patch(label="estimate, trusted", **_TRUSTED),
            Patch(label="(not trusted): difference to the finest run", **_NOT_TRUSTED),
        ],
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=9,
    )
    return figure


def _panel(quantity: Quantity, axis: Axes) -> None:
    sizes = [abs(each.estimate) if isfinite(each.estimate) else 0.0 for each in quantity.contributions]
    for place, (each, size) in enumerate(zip(quantity.contributions, sizes, strict=True)):
        axis.barh(place, size, height=0.62, **(_TRUSTED if each.trusted else _NOT_TRUSTED))
        axis.annotate(
            _label(each), (size, place), (4.0, 0.0), textcoords="offset points", va="center", ha="left", fontsize=8
        )
    axis.set_xlim(0.0, _ROOM * max(sizes) if max(sizes) > 0.0 else 1.0)
    axis.invert_yaxis()
    axis.set_title(f"{quantity.spoken}\n{measured(quantity)}", fontsize=10)
    axis.set_xlabel(f"error ({quantity.unit})" if quantity.unit else "error", fontsize=9)
    axis.tick_params(axis="x", labelsize=8)
    axis.locator_params(axis="x", nbins=4)
    axis.spines[["top", "right"]].set_visible(False)


def _label(contribution: Contribution) -> str:
    if not isfinite(contribution.estimate):
        return "unknown"
    if contribution.negligible:
        return "negligible"
    text = f"{contribution.estimate:+.2g}".replace("-", "−")
    # Bars may be too short to see how they are filled.
    return text if contribution.trusted else f"({text})"
