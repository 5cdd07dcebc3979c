"""The text around the pictures of a map: its axes, what theory predicts, and what counts as inaccurate."""

from math import isfinite
from pathlib import Path

from ...orchestrator.results.comparison import unit_of
from ..pictures.provenance import machine_text, note_texts
from .counts import apart
from .map import StabilityMap
from .placed_panel import PlacedPanel


def title(found: StabilityMap) -> str:
    """What is mapped."""
    return f"{found.name}: where runs of {Path(found.scenario).name} are sound"


def axes_text(found: StabilityMap) -> str:
    """The whole keys of the axes; of each panel where they differ."""
    texts = {panel.name: f"x axis {panel.x_key}, y axis {panel.y_key}" for panel in found.panels}
    if len(set(texts.values())) == 1:
        return f"Every box is one run; {next(iter(texts.values()))}."
    return f"Every box is one run. {'; '.join(f'{name}: {text}' for name, text in texts.items())}."


def theory_text(found: StabilityMap, placed: list[PlacedPanel]) -> str:
    """What is predicted, and whether it is on the map."""
    if not found.theory:
        return ""
    text = f"Theory ({found.theory}): stable where {found.formula or 'disturbances do not grow'}"
    if any(each.limit for each in placed):
        return f"{text}."
    return f"{text}; that boundary does not cross this map."


def agreement_text(found: StabilityMap) -> str:
    """How far measured crossings are from predicted ones; empty where there are none to compare."""
    known = [apart(crossing) for panel in found.panels for crossing in panel.crossings]
    distances = [abs(distance) for distance in known if distance is not None]
    if not distances:
        return ""
    where = "At one place" if len(distances) == 1 else f"At all of {len(distances)} places"
    return f"{where} the measured boundary is within {100.0 * max(distances):.2g} % of the predicted one."


def tolerance_text(found: StabilityMap) -> str:
    """From which error on a run is inaccurate; empty without tolerances."""
    if not found.tolerances:
        return ""
    said = [f"in {name} of more than {limit:g} {unit_of(name)}".rstrip() for name, limit in found.tolerances.items()]
    return f"Inaccurate: an error {' or '.join(said)}."


def reference_text(found: StabilityMap) -> str:
    """What errors are taken from; empty where none are."""
    if not found.references:
        return ""
    return f"Errors are differences from the reference ({'; '.join(found.references)})."


def sentences(found: StabilityMap, placed: list[PlacedPanel]) -> list[str]:
    """All that is said below a picture; the versions stand on the page alone."""
    texts = [
        axes_text(found),
        theory_text(found, placed),
        agreement_text(found),
        tolerance_text(found),
        reference_text(found),
        machine_text(found.machine),
        *note_texts(found.notes),
    ]
    return [text for text in texts if text]


def error_text(name: str, error: float) -> str:
    """An error in its unit of measure."""
    return f"{f'{error:.3g}' if isfinite(error) else 'infinite'} {unit_of(name)}".rstrip()
