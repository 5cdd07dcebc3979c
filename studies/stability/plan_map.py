"""From a study to the grids of a map, checked before anything runs."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ...orchestrator.errors import InputError
from ...orchestrator.participants.native import Theory, stability_theory
from ...orchestrator.scenario import Contradiction, Scenario
from ..plan import Planned, Reference, Variants, load_study, planned_points, stored_reference, variants_of
from ..point import Point, told, value_text
from ..span import Span
from ..study import Line, Settings
from .axis import Axis

#: The key of the communication step, which has to divide a run unless the study counts steps.
_STEP = "coupling.step_ms"


@dataclass(frozen=True)
class Place:
    """A cell to be: where it is, its point, and what it is compared with.

    `point` is None where its settings cannot stand together, and `reason` says why. `reference` is None without one; a
    text says why there is none for this cell.
    """

    x: Any
    y: Any
    point: Point | None
    reason: str = ""
    reference: Reference | str | None = None
    bisected: bool = False


@dataclass(frozen=True)
class Grid:
    """A line of the study: its two axes and the places of its grid."""

    line: Line
    x: Axis
    y: Axis
    places: Sequence[Place]


class MapPlan:
    """A study of stability, ready to run.

    Attributes
    ----------
    study, path:
        The study and its file.
    theory:
        What predicts the boundary; None without.
    grids:
        One for each line.
    base:
        The folder that the paths of its scenarios are relative to.
    """

    def __init__(self, path: Path, assignments: Iterable[str] = ()) -> None:
        self.path = path
        self.study = load_study(path)
        self.theory = self._theory()
        axes = [_axes(line, path) for line in self.study.lines]
        if self.study.bisect:
            for line, (_, y) in zip(self.study.lines, axes, strict=True):
                self._check_divisible(line, y)
        self._variants = variants_of(self.study, path, assignments)
        # Any communication step divides one step: for predictions, which are of no length.
        self._one_step = Variants(self._variants.file, self._variants.common, str(path), 1)
        self.base = self._variants.file.parent
        self.grids = [
            Grid(
                line,
                *of_line,
                [self._compared(line, *of_line, each) for each in planned_points(self._variants, line, path)],
            )
            for line, of_line in zip(self.study.lines, axes, strict=True)
        ]

    @property
    def origin(self) -> str:
        """The study's file, as it stands in front of what is wrong with it."""
        return str(self.path)

    @property
    def references_told(self) -> list[str]:
        """What errors are taken from, in words."""
        if not self.study.references:
            return []
        settings = self.study.references[0]
        return [f"results: {settings['results']}" if "results" in settings else f"the same with {told(settings)}"]

    def between(self, grid: Grid, x: Any, y: float) -> Place | None:
        """The place at a value that the study's grid does not have; None where the scenario cannot have it.

        A key that takes whole numbers only gets the nearest one.
        """
        for value in (y, round(y)):
            settings = {grid.x.key: x, grid.y.key: value}
            try:
                point = self._point(grid.line, settings)
            except Contradiction as error:
                planned = Planned(settings, None, error.problem)
            except InputError:
                continue
            else:
                planned = Planned(settings, point)
            return replace(self._compared(grid.line, grid.x, grid.y, planned), bisected=True)
        return None

    def scenario(self, grid: Grid, x: Any, y: Any) -> Scenario:
        """The scenario at any two values, for one communication step; InputError where it cannot have them."""
        where = f"lines, '{grid.line.name}'"
        return self._one_step.scenario(dict(grid.line.set) | {grid.x.key: x, grid.y.key: y}, where)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _theory(self) -> Theory | None:
        if self.study.theory is None:
            return None
        try:
            return stability_theory(self.study.theory)
        except InputError as error:
            raise InputError(f"{self.path}: theory: {error}") from None

    def _check_divisible(self, line: Line, y: Axis) -> None:
        if y.key == _STEP and self.study.steps is None:
            raise InputError(
                f"{self.path}: bisect: steps between those of the line '{line.name}' do not divide `run.stop_ms`; give "
                "`steps`, the number of communication steps of every run, or remove `bisect`"
            )

    def _point(self, line: Line, settings: Settings) -> Point:
        point = self._variants.point(dict(line.set) | settings, f"lines, '{line.name}'")
        return Point(point.scenario, point.base, settings)

    def _compared(self, line: Line, x: Axis, y: Axis, planned: Planned) -> Place:
        """The place of a planned point, with its reference: its own settings with those of the study's on top."""
        at = planned.settings[x.key], planned.settings[y.key]
        if planned.point is None or not self.study.references:
            return Place(*at, planned.point, planned.reason)
        settings = self.study.references[0]
        if "results" in settings:
            return Place(*at, planned.point, reference=stored_reference(self.path, settings))
        whole = dict(line.set) | dict(planned.settings) | settings
        # A finer step is to reach as far as the run that is compared with it.
        span = None if self.study.steps is None else Span.of(planned.point.scenario)
        try:
            point = self._variants.point(whole, f"reference of the line '{line.name}'", span)
        except Contradiction as error:
            return Place(*at, planned.point, reference=f"its reference cannot be run: {error.problem}")
        return Place(*at, planned.point, reference=Reference(f"reference: {told(settings)}", point))


def plan_map(path: Path, assignments: Iterable[str] = ()) -> MapPlan:
    """The map of the study in `path`, with the `assignments` (`key.path=value`) for every run.

    InputError for a line that does not vary two keys, for a theory that there is not, and for all that `plan_study`
    finds wrong; a reference is needed for `tolerances` only.
    """
    return MapPlan(path, assignments)


def _axes(line: Line, path: Path) -> tuple[Axis, Axis]:
    if len(line.vary) != 2:
        raise InputError(
            f"{path}: lines, '{line.name}': a map has two axes, and `vary` has {len(line.vary)} keys; vary exactly "
            "two, that of the x axis first, and put others in `set`"
        )
    x, y = (Axis(key, values) for key, values in line.vary.items())
    for axis in (x, y):
        for place, value in enumerate(axis.values):
            if value in axis.values[:place]:
                raise InputError(
                    f"{path}: lines, '{line.name}': '{axis.key}' has the value {value_text(value)} twice; remove one"
                )
    return x, y
