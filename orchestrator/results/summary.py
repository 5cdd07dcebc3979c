"""summary.json: the run in a few numbers, and the scenario it came from."""

import json
from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import Any

from ..scenario import Scenario
from .origin import Origin
from .time_series import TimeSeries
from .whole import write_whole

#: Potential in mV whose upward crossing at a probe is its activation.
ACTIVATION_MV = -20.0

#: The kinds of what every summary has and whoever reads one relies on.
_KINDS: dict[str, type | tuple[type, ...]] = {
    "end_ms": (int, float),
    "steps": int,
    "activation_time_ms": dict,
    "ejection_fraction": dict,
    "unconverged_ms": list,
    "tolerance_missed": dict,
    "growth": dict,
    "warnings": list,
    "wall_s": dict,
    "cpu_s": dict,
    "solves": dict,
    "sweeps": int,
}


def write_summary(
    path: Path,
    scenario: Scenario,
    origin: Origin,
    series: TimeSeries,
    costs: Mapping[str, Any],
    outcome: Mapping[str, Any],
) -> dict[str, Any]:
    """Write the summary of a finished or failed run and return it.

    `origin` says what the numbers come from. `costs` has `wall_s`, with `total` and `master` in it, and whatever else
    was measured; `outcome` has `status`.
    """
    time = series.column("time_ms")

    def known(column: str) -> list[tuple[float, float]]:
        # Units that step less often leave empty cells.
        return [pair for pair in zip(time, series.column(column), strict=True) if not isnan(pair[1])]

    content: dict[str, Any] = {
        **outcome,
        "name": scenario.name,
        "end_ms": time[-1] if time else None,
        "steps": max(len(time) - 1, 0),
        "activation_time_ms": {
            probe: crossing_time(*_columns(known(f"potential_{probe}_mV")), ACTIVATION_MV)
            for probe in scenario.output.probes_mm
            if f"potential_{probe}_mV" in series.columns
        },
    }
    ejected = {}
    for column in series.columns[1:]:
        if column in series.texts:
            continue
        _, values = _columns(known(column))
        # An output of a foreign FMU may have the name of one of the summary's own keys, which wins.
        if values and not column.startswith("potential_") and column not in content:
            content[column] = {"start": values[0], "min": min(values), "max": max(values), "end": values[-1]}
            if column.endswith("_volume_ml") and values[0] > 0.0:
                ejected[column.removesuffix("_volume_ml")] = (values[0] - min(values)) / values[0]
    content["ejection_fraction"] = ejected
    content |= costs
    seconds = costs["wall_s"]
    content["master_overhead"] = seconds["master"] / seconds["total"] if seconds["total"] else None
    content |= origin.content()
    write_whole(path, f"{json.dumps(content, indent=2, allow_nan=False)}\n".encode())
    return content


def is_summary(content: Mapping[str, Any]) -> bool:
    """Whether `content` has all that readers of the summary of a finished run rely on."""

    def numbers(values: Iterable[Any]) -> bool:
        return all(isinstance(value, (int, float)) for value in values)

    if not all(isinstance(content.get(key), kind) for key, kind in _KINDS.items()):
        return False
    volumes = [content.get(f"{chamber}_volume_ml") for chamber in content["ejection_fraction"]]
    return (
        numbers([content["wall_s"].get("total"), *content["unconverged_ms"], *content["ejection_fraction"].values()])
        and isinstance(content["tolerance_missed"].get("steps"), int)
        and numbers(value for value in (content["tolerance_missed"].get("first_ms"),) if value is not None)
        and numbers(value for value in content["activation_time_ms"].values() if value is not None)
        and all(isinstance(volume, dict) and numbers([volume.get("start"), volume.get("min")]) for volume in volumes)
    )


def _columns(pairs: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [time for time, _ in pairs], [value for _, value in pairs]


def crossing_time(time: Sequence[float], values: Sequence[float], threshold: float) -> float | None:
    """First upward crossing of `threshold`, linear between the samples; None if there is none.

    Values that start at or above the threshold cross it at the first time.
    """
    if values and values[0] >= threshold:
        return time[0]
    for (early, low), (late, high) in zip(
        zip(time, values, strict=True), zip(time[1:], values[1:], strict=True), strict=False
    ):
        if low < threshold <= high:
            return early + (late - early) * (threshold - low) / (high - low)
    return None
