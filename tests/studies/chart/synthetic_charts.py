"""Charts without runs, for the tests of the pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
from cardiac_cosim.orchestrator.results.comparison import Difference, Measure
from cardiac_cosim.studies.chart.chart import CPU, WALL, Chart, ChartLine, Row
from cardiac_cosim.studies.chart.front import on_front
from cardiac_cosim.studies.order import observed_order, step_of
from cardiac_cosim.studies.trial import CRASHED, DONE, FAILED, REFUSED, Cost, Trial

MEASURES = (
    Measure("activation_ms", "ms", "activation at the probes, largest difference", lambda *_: Difference(nan)),
    Measure("lv_volume_ml", "ml", "lv volume, largest difference at any time", lambda *_: Difference(nan)),
    Measure(
        "active_stress_kPa",
        "kPa",
        "active stress, root mean square over the mesh at the worst time",
        lambda *_: Difference(nan),
    ),
)


def done(
    settings: Mapping[str, Any],
    errors: Mapping[str, float],
    wall_s: float = 1.0,
    solves: int = 30,
    spread: float = 0.0,
    reason: str = "",
) -> Row:
    """A point with results, run three times if it has a `spread`, which is a part of its time."""
    walls = [wall_s] if not spread else [wall_s * (1.0 - spread), wall_s, wall_s * (1.0 + spread)]
    costs = tuple(Cost(wall, 0.9 * wall, {"electrophysiology": 0.6 * wall, "mechanics": 0.3 * wall}) for wall in walls)
    trial = Trial(
        Path("point"), DONE, "", costs, {"electrophysiology": solves - solves // 3, "mechanics": solves // 3}, solves
    )
    return Row(settings, DONE, reason, trial, errors)


def without_results(settings: Mapping[str, Any], status: str, reason: str) -> Row:
    return Row(settings, status, reason, None if status == REFUSED else Trial(Path("point"), status, reason))


def chart_of(
    lines: Mapping[str, Sequence[Row]],
    measures: Sequence[Measure] = MEASURES,
    uncertainty: Mapping[str, float] | None = None,
    cost: str = WALL,
    **other: Any,
) -> Chart:
    """A chart with its fronts and orders found as in a study."""
    uncertainty = uncertainty or {}
    rows = [row for line in lines.values() for row in line if row.is_done]
    fronts: dict[int, set[str]] = {id(row): set() for row in rows}
    for measure in measures:
        on = on_front([row.cost(cost) for row in rows], [row.errors.get(measure.name, nan) for row in rows])
        for row, is_on in zip(rows, on, strict=True):
            if is_on:
                fronts[id(row)].add(measure.name)
    made = []
    for name, line in lines.items():
        orders = {}
        for measure in measures:
            finished = [row for row in line if row.is_done]
            steps = [step_of(row.settings) for row in finished]
            errors = [row.errors.get(measure.name, nan) for row in finished]
            order = observed_order(steps, errors, uncertainty.get(measure.name, 0.0))
            if order is not None:
                orders[measure.name] = order
        made.append(ChartLine(name, [replace(row, front=frozenset(fronts.get(id(row), ()))) for row in line], orders))
    given = {
        "name": "coupling_step",
        "scenario": "../scenarios/baseline.yaml",
        "references": ["coupling.step_ms=0.1", "coupling.step_ms=0.2"] if uncertainty else ["coupling.step_ms=0.1"],
        "machine": {
            "processor": "AMD EPYC 7B13",
            "cores": 2,
            "memory_GB": 25,
            "system": "Linux 6.1",
            "python": "3.12.4",
        },
        "versions": {"python": "3.12.4", "numpy": "2.3.1", "scipy": "1.16.0"},
    }
    return Chart(cost=cost, measures=measures, lines=made, uncertainty=uncertainty, **(given | other))


def realistic(seed: int = 1) -> Chart:
    """Five lines of five steps and three measures, with orders 1 and 2, noise, and some points without results."""
    noise = np.random.default_rng(seed)
    steps = [0.5, 1.0, 2.0, 5.0, 10.0]
    schemes = {
        "Gauss–Seidel, held": (1, 1.0, 1.0),
        "Gauss–Seidel, ramped": (2, 0.15, 1.02),
        "Jacobi, held": (1, 1.9, 0.97),
        "Gauss–Seidel, iterated to 1e-6, Aitken": (1, 0.6, 3.1),
        "Strang": (2, 0.22, 1.25),
    }
    sizes = {"activation_ms": 0.9, "lv_volume_ml": 0.05, "active_stress_kPa": 0.2}
    lines: dict[str, list[Row]] = {}
    for name, (order, factor, work) in schemes.items():
        lines[name] = []
        for step in steps:
            settings = {"coupling.step_ms": step}
            if name.startswith("Jacobi") and step >= 5.0:
                lines[name].append(
                    without_results(
                        settings,
                        FAILED,
                        "mechanics: no equilibrium at 105 ms, residual 3.2e-3; shorten coupling.step_ms",
                    )
                )
                continue
            if name == "Strang" and step == 10.0:
                lines[name].append(
                    without_results(
                        settings, REFUSED, "coupling.step_ms must divide output.every_ms (5) with this scheme"
                    )
                )
                continue
            if "iterated" in name and step == 10.0:
                lines[name].append(without_results(settings, CRASHED, "the process that ran it died"))
                continue
            wall = work * (1.5 + 12.0 / step) * noise.lognormal(0.0, 0.05)
            errors = {
                measure: size * factor * step**order * noise.lognormal(0.0, 0.12) for measure, size in sizes.items()
            }
            if name == "Gauss–Seidel, held" and step == 10.0:
                errors["activation_ms"] = inf
            spread = 0.12 if wall < 4.0 else 0.0
            reason = "the probe apex is never activated" if not all(map(isfinite, errors.values())) else ""
            lines[name].append(done(settings, errors, wall, int(3 * 320 / step * work), spread, reason))
    return chart_of(
        lines, uncertainty={"activation_ms": 0.3, "lv_volume_ml": 0.004}, notes=["4 of 25 points have no results"]
    )


__all__ = ["CPU", "MEASURES", "WALL", "chart_of", "done", "realistic", "without_results"]
