"""Stability maps without runs, for the tests of their pictures."""

from collections.abc import Callable, Sequence
from math import cos, inf, isfinite, pi, sqrt
from pathlib import Path
from typing import Any

from cardiac_cosim.studies.stability.map import (
    DIVERGED,
    INACCURATE,
    KINDS,
    NOT_CONVERGED,
    NOT_RUN,
    OSCILLATING,
    SOUND,
    UNIT_FAILED,
    Cell,
    Crossing,
    Panel,
    StabilityMap,
)
from cardiac_cosim.studies.trial import DONE, Cost, Trial

GAIN, STEP = "units.active_stress.parameters.length_dependence", "coupling.step_ms"
STIFFNESS, EVERY = "units.second.parameters.k", "coupling.iterate"

_MACHINE = {"processor": "AMD EPYC 7B13", "cores": 2, "memory_GB": 25, "system": "Linux 6.1", "python": "3.12.4"}


def trial(wall_s: float = 1.5) -> Trial:
    """A run that took so long."""
    return Trial(Path("point"), DONE, "", (Cost(wall_s, 0.9 * wall_s, {}),), {"mechanics": 30}, 30)


def map_of(panels: Sequence[Panel], **other: Any) -> StabilityMap:
    """A map of these panels, with something to say about everything."""
    given: dict[str, Any] = {
        "name": "loop_gain",
        "scenario": "../scenarios/cell.yaml",
        "theory": "loop_gain",
        "formula": "|g| < 1, g = −K_a/K_p",
        "tolerances": {"lv_volume_ml": 0.5, "activation_ms": 2.0},
        "references": ["the same with coupling.step_ms=0.1"],
        "machine": _MACHINE,
        "versions": {"python": "3.12.4", "numpy": "2.3.1"},
    }
    return StabilityMap(panels=panels, **(given | other))


def panel_of(
    xs: Sequence[Any], ys: Sequence[Any], kind: Callable[[Any, Any], str], name: str = "explicit", **other: Any
) -> Panel:
    """A panel whose classes are those of `kind` at x and y."""
    cells = [Cell(x, y, kind(x, y), _REASONS[kind(x, y)], trial=trial()) for y in ys for x in xs]
    return Panel(**({"name": name, "x_key": GAIN, "y_key": STEP, "xs": xs, "ys": ys, "cells": cells} | other))


def bisected(
    x: Any, low: float, high: float, times: int, boundary: float, outside: str, is_geometric: bool = False
) -> tuple[list[Cell], Crossing]:
    """The runs that halve the distance along y until a boundary lies between two neighbours; sound is below it."""
    cells = []
    for _ in range(times):
        middle = sqrt(low * high) if is_geometric else 0.5 * (low + high)
        kind = SOUND if middle < boundary else outside
        cells.append(Cell(x, middle, kind, _REASONS[kind], measure=middle / boundary, trial=trial(), bisected=True))
        low, high = (middle, high) if kind == SOUND else (low, middle)
    return cells, Crossing(x, low, high, boundary)


def loop_gain() -> StabilityMap:
    """An explicit loop: what is stable does not depend on the step, and the boundary is upright."""
    xs, ys = [0.5, 0.8, 0.95, 1.05, 1.25, 2.0], [0.2, 0.5, 1.0, 2.0, 5.0, 10.0]

    def kind(x: float, y: float) -> str:
        if x < 1.0:
            return INACCURATE if y > 4.0 else SOUND
        return DIVERGED if x > 1.5 else OSCILLATING

    cells = [
        Cell(
            x,
            y,
            kind(x, y),
            _REASONS[kind(x, y)],
            measure=1.001 * x,
            predicted=x,
            errors={"lv_volume_ml": 0.12 * y, "activation_ms": inf if x > 1.5 else 0.3 * y},
            trial=trial(10.0 / y),
        )
        for y in ys
        for x in xs
    ]
    limit = [[(1.0, y) for y in (0.1, 1.0, 15.0)]]
    return map_of([Panel("Gauss–Seidel, held inputs", GAIN, STEP, xs, ys, cells, limit=limit)])


def oscillator() -> StabilityMap:
    """Two masses: a curved boundary over a logarithmic step, found by bisection in every column."""
    xs, ys = [2.0, 5.0, 10.0, 20.0, 40.0, 80.0], [10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0]

    def boundary(x: float) -> float:
        return 900.0 / x**0.8

    grid, crossings = [], []
    panel = panel_of(
        xs, ys, lambda x, y: SOUND if y < boundary(x) else DIVERGED if y > 3.0 * boundary(x) else OSCILLATING
    )
    grid += panel.cells
    for x in xs:
        below = max((y for y in ys if y < boundary(x)), default=0.0)
        above = min((y for y in ys if y > boundary(x)), default=inf)
        if below > 0.0 and isfinite(above):
            cells, crossing = bisected(x, below, above, 6, 1.004 * boundary(x), OSCILLATING, True)
            grid += cells
            crossings.append(Crossing(x, crossing.low, crossing.high, boundary(x)))
    limit = [
        [(x, boundary(x)) for x in (1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0, 80.0, 120.0)]
    ]
    names = {"x_key": STIFFNESS, "y_key": STEP, "cells": grid, "crossings": crossings, "limit": limit}
    return map_of(
        [panel_of(xs, ys, lambda *_: SOUND, "displacement–displacement", **names)],
        name="oscillator",
        scenario="oscillator.yaml",
        theory="two_masses",
        formula="ρ(A(H)) < 1 with A the exact map of all states from one exchange to the next",
        tolerances={},
        references=[],
    )


def categories() -> StabilityMap:
    """Schemes and ways to iterate: no axis has numbers."""
    xs, ys = ["jacobi", "gauss-seidel"], [None, {"max_iterations": 20, "acceleration": "anderson"}]
    kinds = {("jacobi", True): DIVERGED, ("gauss-seidel", True): OSCILLATING, ("jacobi", False): NOT_CONVERGED}
    panel = panel_of(
        xs,
        ys,
        lambda x, y: kinds.get((x, y is None), SOUND),
        "remedies",
        x_key="coupling.scheme",
        y_key=EVERY,
    )
    return map_of([panel], name="remedies", theory="", formula="", tolerances={}, references=[])


def schemes() -> StabilityMap:
    """Categories to the right and numbers upwards, with the limit of each."""
    xs, ys = ["jacobi", "gauss-seidel", "strang"], [0.1, 0.2, 0.3, 0.4]
    limits = {"jacobi": 0.225, "gauss-seidel": 0.0777, "strang": 0.318}
    cells, crossings = [], []
    for x in xs:
        for y in ys:
            cells.append(Cell(x, y, SOUND if y < limits[x] else DIVERGED, "", trial=trial()))
        below = max((y for y in ys if y < limits[x]), default=0.0)
        if below:
            found, crossing = bisected(x, below, below + 0.1, 5, limits[x], DIVERGED)
            cells += found
            crossings.append(crossing)
    panel = Panel("by scheme", "coupling.scheme", STEP, xs, ys, cells, crossings)
    return map_of([panel], name="schemes", formula="ρ(A(H)) < 1")


def four_panels() -> StabilityMap:
    """All classes over four panels, one with a long name, and sine curves for boundaries."""
    xs, ys = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0], [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]
    names = [
        "Jacobi",
        "Gauss–Seidel",
        "Gauss–Seidel, linear inputs, extrapolated to first order, with the consistent stabilisation of the tension",
        "iterated",
    ]
    panels = []
    for number, name in enumerate(names):

        def boundary(x: float, number: int = number) -> float:
            return 1.7 + 0.5 * cos(0.5 * pi * (x + number))

        cells, crossings = [], []
        for x in xs:
            for y in ys:
                kind = SOUND if y < boundary(x) else KINDS[1 + (int(x) + 2 * number) % 6]
                cells.append(Cell(x, y, kind, _REASONS[kind], y / boundary(x), y / boundary(x), trial=trial()))
            below = max(y for y in ys if y < boundary(x))
            found, crossing = bisected(x, below, below + 0.5, 4, 1.01 * boundary(x), OSCILLATING)
            cells += found
            crossings.append(crossing)
        limit = [[(0.1 * place, boundary(0.1 * place)) for place in range(100)]]
        panels.append(Panel(name, "units.first.parameters.c", STEP, xs, ys, cells, crossings, limit))
    return map_of(panels, name="four_schemes", notes=["3 of 168 cells were not run", "the reference took 20 s"])


def all_kinds() -> StabilityMap:
    """A column for each class, over numbers that are not in order."""
    xs = [3, 1, 2, 7, 5, 6, 4]
    return map_of([panel_of(xs, [0.1], lambda x, _: KINDS[x - 1], x_key="run.repeat")], formula="")


def long_keys() -> StabilityMap:
    """Long keys and long values."""
    xs = [
        {"max_iterations": 50, "acceleration": "relaxation", "converge": {"stretch": {"relative": 1e-06}}},
        {"max_iterations": 50, "acceleration": "aitken", "converge": {"stretch": {"relative": 1e-06}}},
        "a value without any space in it " + "x" * 60,
        [1, 2, 3],
        None,
        True,
    ]
    ys = ["conjugate_gradients_with_multigrid_" + each for each in ("exact", "approximate")] + [xs[0]]
    panel = panel_of(
        xs,
        ys,
        lambda x, y: SOUND if x is None else UNIT_FAILED if y == ys[0] else NOT_RUN,
        "the name of a line which is longer than anybody would want to write it down, and then once more as long",
        x_key="units.the_mechanics_of_the_left_ventricle.parameters.acceleration_of_the_iterations_between_units_and_fields",
        y_key="units.mechanics.parameters.linear_solver_of_the_equilibrium_of_the_tissue_at_every_communication_step_ms",
    )
    return map_of([panel], name="long_names_of_many_things", notes=["a note " * 60])


_REASONS = {
    SOUND: "",
    INACCURATE: "the error in lv_volume_ml is 1.2 ml, the tolerance 0.5",
    OSCILLATING: "mechanics.stretch alternates and grows by 1.31 from step to step",
    DIVERGED: "mechanics: no equilibrium at 105 ms, residual 3.2e-3, after mechanics.stretch grew by 1.9 per step",
    NOT_CONVERGED: "the coupling iteration did not converge at 12 ms within 50 sweeps",
    UNIT_FAILED: "mechanics: element 12 is inverted at 40 ms",
    NOT_RUN: "coupling.step_ms must divide output.every_ms (5) with this scheme",
}

ALL = {
    "loop gain": loop_gain,
    "oscillator": oscillator,
    "categories": categories,
    "schemes": schemes,
    "four panels": four_panels,
    "all classes": all_kinds,
    "long keys": long_keys,
}
