"""The measurements as tables for docs/speed.md."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from math import log
from typing import Any

Measured = dict[str, Any]


def tables(record: dict[str, Any]) -> str:
    """All tables of one `record`, in Markdown."""
    measured: list[Measured] = record["measured"]
    machine = record["machine"]
    named = ", ".join(f"{name} {machine[name]}" for name in ("python", "numpy", "scipy", "rslab"))
    parts = [
        f"Measured on {record['date']} at commit {record['commit']}: {machine['processor']}; {named}.",
        _heartbeats(measured),
        _growth(measured),
        _solids(measured),
        _exchanges(measured),
        _electrophysiology(measured),
    ]
    return "\n\n".join(part for part in parts if part)


def of_kind(measured: list[Measured], kind: str) -> list[Measured]:
    """The measurements of one kind, by decreasing size of the mesh."""
    return sorted((one for one in measured if one["kind"] == kind), key=lambda one: -one["size_mm"])


def factorisations(one: Measured) -> float:
    """The duration of the time loop of a heartbeat, in factorisations of its own stiffness."""
    return 1e3 * float(one["loop_s"]) / float(one["factorisation_ms"])


def exponent(finer: Measured, coarser: Measured, value: Callable[[Measured], float], size: str) -> float:
    """p in value ~ size^p."""
    return log(value(finer) / value(coarser)) / log(finer[size] / coarser[size])


def _heartbeats(measured: list[Measured]) -> str:
    rows = [
        [
            f"{one['size_mm']:g} mm",
            {"native": "direct calls", "fmu": "FMI 2.0", "fmu3": "FMI 3.0"}[one["participants"]],
            f"{one['unknowns']}",
            f"{one['loop_s']:.2f}",
            f"{one['factorisation_ms']:.1f}",
            f"**{factorisations(one):.0f}**",
            f"{one['units_s']['mechanics']:.2f}",
            f"{one['units_s']['electrophysiology']:.2f}",
            f"{one['master_s']:.2f}",
            f"{one['peak_MB']:.0f}",
        ]
        for one in of_kind(measured, "heartbeat")
    ]
    names = (
        "heartbeat, mesh size",
        "interface",
        "unknowns",
        "time loop, s",
        "one factorisation, ms",
        "time loop in factorisations",
        "mechanics, s",
        "electrophysiology, s",
        "master, s",
        "peak memory, MB",
    )
    return _table(names, rows)


def _growth(measured: list[Measured]) -> str:
    native = [one for one in of_kind(measured, "heartbeat") if one["participants"] == "native"]
    pairs = [*pairwise(native)]
    by_size = {one["size_mm"]: one for one in native}
    if 5.0 in by_size and 2.0 in by_size:
        pairs.append((by_size[5.0], by_size[2.0]))
    rows = [
        [
            f"{coarser['size_mm']:g} to {finer['size_mm']:g} mm",
            *(f"{exponent(finer, coarser, value, 'unknowns'):.2f}" for value in _GROWING.values()),
        ]
        for coarser, finer in pairs
    ]
    return _table(("exponent of the growth with the unknowns", *_GROWING), rows) if rows else ""


_GROWING: dict[str, Callable[[Measured], float]] = {
    "time loop": lambda one: float(one["loop_s"]),
    "mechanics": lambda one: float(one["units_s"]["mechanics"]),
    "electrophysiology": lambda one: float(one["units_s"]["electrophysiology"]),
    "one factorisation": lambda one: float(one["factorisation_ms"]),
}


def _solids(measured: list[Measured]) -> str:
    rows = [
        [f"{one['size_mm']:g} mm", *(f"{one[f'{name}_ms']:.2f}" for name in ("residual", "tangent", "stretch"))]
        for one in of_kind(measured, "solid")
    ]
    return _table(("mechanics, ms per evaluation", "residual", "tangent", "stretch"), rows)


def _exchanges(measured: list[Measured]) -> str:
    rows = [
        [f"{one['size_mm']:g} mm", f"{one['elements']}", f"{one['fmi2_ms']:.2f}", f"{one['fmi3_ms']:.2f}"]
        for one in of_kind(measured, "exchange")
    ]
    return _table(("exchange of the fields, ms per step", "elements", "FMI 2.0", "FMI 3.0"), rows)


def _electrophysiology(measured: list[Measured]) -> str:
    alone = of_kind(measured, "electrophysiology")
    rows = []
    for number, one in enumerate(alone):
        growth = ["", ""]
        if number:
            growth = [
                f"{exponent(one, alone[number - 1], lambda of, name=name: float(of[name]), 'elements'):.2f}"  # type: ignore[misc]
                for name in ("setup_s", "ms_per_step")
            ]
        rows.append(
            [
                f"{one['size_mm']:g} mm",
                f"{one['elements']}",
                f"{one['setup_s']:.2f}",
                growth[0],
                f"{one['ms_per_step']:.2f}",
                growth[1],
                f"{one['peak_MB']:.0f}",
            ]
        )
    names = (
        "electrophysiology alone",
        "elements",
        "set-up, s",
        "exponent",
        "step of 1 ms, ms",
        "exponent",
        "peak memory, MB",
    )
    return _table(names, rows)


def _table(names: Sequence[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(names)} |", "|---" * len(names) + "|", *(f"| {' | '.join(row)} |" for row in rows)]
    return "\n".join(lines)
