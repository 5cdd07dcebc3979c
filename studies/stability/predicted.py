"""What theory predicts of a scenario: by which factor disturbances grow from one exchange to the next.

A theory of the exchange is of explicit coupling with steps of one size. Of iterated and of adaptive coupling it says
nothing, and neither does this, unless the theory calls itself one of steps inside of units (`of_exchange = False`). A
theory whose evaluation takes long says so (`costly = True`).
"""

import json
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any

from ...orchestrator.assembly import checked_mesh
from ...orchestrator.errors import InputError
from ...orchestrator.participants.native import (
    Coupled,
    Mesh,
    Moment,
    Setting,
    Theory,
    amplification,
    unit_setting,
)
from ...orchestrator.scenario import Scenario
from .moments import moments_in

#: How theories call a unit that is an FMU, of which only the given parameters are known.
_FMU = "fmu"


class Predictor:
    """Asks a theory, and remembers what it said of systems that are the same to it.

    Parameters
    ----------
    theory:
        Which is asked.
    base:
        The folder that the paths of scenarios are relative to.
    origin:
        The study's file, which stands in front of what is wrong.
    """

    def __init__(self, theory: Theory, base: Path, origin: str) -> None:
        self._theory = theory
        self._base = base
        self._origin = origin
        self._known: dict[str, float | None] = {}
        self._meshes: dict[str, Mesh] = {}

    @property
    def is_costly(self) -> bool:
        """Whether an evaluation takes long."""
        return self._theory.costly

    def applies(self, scenario: Scenario) -> bool:
        """Whether the theory says anything of such a coupling."""
        if not self._theory.of_exchange:
            return True
        return scenario.coupling.iterate is None and scenario.coupling.adaptive is None

    def amplification(self, scenario: Scenario, reference: Path | None = None) -> float | None:
        """The factor of a scenario; None where the theory says nothing of it, or comes to no result.

        `reference` is the folder of a sound run of the same system, where there is one.

        Raises
        ------
        InputError
            Where the theory does not fit the scenario.
        """
        if not self.applies(scenario):
            return None
        units = self._units(scenario)
        key = self._key(scenario, units, reference)
        if key not in self._known:
            try:
                found = amplification(self._theory, self._coupled(scenario, units, reference))
            except InputError as error:
                raise InputError(
                    f"{self._origin}: theory: '{self._theory.name}' does not fit the scenario: {error}; change the "
                    "scenario, or name another theory or none"
                ) from None
            self._known[key] = None if isnan(found) else float(found)
        return self._known[key]

    # --- inside -------------------------------------------------------------------------------------------------------

    def _units(self, scenario: Scenario) -> dict[str, Setting]:
        """The units in their order, those first that it does not name, because they never step."""
        found: dict[str, Setting] = {}
        for name, entry in scenario.units.items():
            if entry.every > 1 and self._theory.of_exchange:
                raise InputError(
                    f"{self._origin}: theory: '{self._theory.name}' is of units that step at every exchange, and "
                    f"`units.{name}.every` is {entry.every}; remove `every` or `theory`"
                )
            if entry.unit is None:
                found[name] = Setting(_FMU, dict(entry.parameters) | dict(entry.start))
            else:
                found[name] = unit_setting(entry.unit, entry.parameters)
        order = scenario.coupling.order or ()
        return {name: found[name] for name in [*(name for name in found if name not in order), *order]}

    def _coupled(self, scenario: Scenario, units: dict[str, Setting], reference: Path | None) -> Coupled:
        coupling = scenario.coupling

        def mesh() -> Mesh:
            return self._mesh(scenario)

        def moments() -> Sequence[Moment]:
            return () if reference is None else moments_in(reference)

        return Coupled(
            units,
            coupling.scheme == "jacobi",
            coupling.step_ms,
            coupling.interpolation == "linear",
            coupling.extrapolation,
            None if scenario.scene is None else mesh,
            moments,
        )

    def _mesh(self, scenario: Scenario) -> Mesh:
        key = "" if scenario.scene is None else scenario.scene.model_dump_json()
        if key not in self._meshes:
            mesh = checked_mesh(scenario, self._base)
            if mesh is None:
                raise InputError("the scenario has no scene")
            self._meshes[key] = mesh
        return self._meshes[key]

    @staticmethod
    def _key(scenario: Scenario, units: dict[str, Setting], reference: Path | None) -> str:
        """All that a theory may ask of a system."""
        coupling, scene = scenario.coupling, scenario.scene
        content: list[Any] = [[name, unit.kind, dict(unit.parameters)] for name, unit in units.items()]
        content += [coupling.scheme, coupling.step_ms, coupling.interpolation, coupling.extrapolation]
        content += [None if scene is None else scene.model_dump(), None if reference is None else str(reference)]
        return json.dumps(content)
