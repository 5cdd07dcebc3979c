"""From a study to its points: every line's combinations of settings, checked before anything runs."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

from ..orchestrator.assembly import check_units
from ..orchestrator.errors import InputError, did_you_mean
from ..orchestrator.scenario import (
    Contradiction,
    Scenario,
    file_content,
    parsed_assignments,
    scenario_content,
    validated,
    with_settings,
)
from .point import Point, told
from .span import EVERY, STOP, Span, with_steps
from .study import Line, Settings, Study


@dataclass(frozen=True)
class Planned:
    """A point of a line; `point` is None where its settings cannot stand together, and `reason` says why."""

    settings: Mapping[str, Any]
    point: Point | None
    reason: str = ""


@dataclass(frozen=True)
class Reference:
    """What points are compared with: a point to be run, or results that are there."""

    origin: str
    point: Point | None = None
    folder: Path | None = None


@dataclass(frozen=True)
class Plan:
    """A study with its points by line, in the order of the file; `origin` is the study's file."""

    study: Study
    origin: str
    references: Sequence[Reference]
    lines: Mapping[str, Sequence[Planned]]

    @property
    def points(self) -> list[Point]:
        """All that can be run."""
        return [planned.point for line in self.lines.values() for planned in line if planned.point is not None]


class Variants:
    """A scenario file with other values at some keys; `origin` stands in front of what is wrong with them.

    With `steps` every run has so many communication steps, whatever their size.
    """

    def __init__(self, file: Path, common: Mapping[str, Any], origin: str, steps: int | None = None) -> None:
        if file.suffix.lower() == ".ssp":
            raise InputError(f"{origin}: {file} is a system package; give the scenario as a YAML file")
        self.file = file
        self.common = dict(common)
        self._origin = origin
        self._steps = steps
        try:
            self._content = scenario_content(file)
        except InputError as error:
            raise InputError(f"{origin}: {error}" if origin != str(file) else str(error)) from None

    def scenario(self, settings: Mapping[str, Any], where: str = "", span: Span | None = None) -> Scenario:
        """The scenario with these settings on top of the common ones; `where` says where they stand in the study.

        With a `span` it is as long as that says, however many steps that are.

        Raises
        ------
        Contradiction
            Where each setting is valid by itself, and they cannot stand together.
        InputError
            For a key that there is not, and for a value that it cannot have.
        """
        both = self.common | dict(settings)
        with_them = f" with {told(both)}" if both else ""
        told_origin = f"{self._origin}: {where}{with_them}" if where else f"{self._origin}{with_them}"
        try:
            self._check_units(both)
            content = with_settings(self._content, both)
            if span is not None:
                content = span.set_in(content)
            elif self._steps is not None:
                content = with_steps(content, self._steps)
        except InputError as error:
            raise InputError(f"{told_origin}: {error}") from None
        scenario = validated(content, Scenario, told_origin)
        try:
            check_units(scenario)
        except InputError as error:
            raise InputError(f"{told_origin}: {error}") from None
        return scenario

    def _check_units(self, settings: Mapping[str, Any]) -> None:
        """InputError for a setting of a unit that the scenario does not have: it would become one without content."""
        units = settings.get("units", self._content.get("units"))
        for key in settings:
            section, *rest = key.split(".")
            if section == "units" and len(rest) > 1 and isinstance(units, Mapping) and rest[0] not in units:
                raise InputError(f"'{key}': the scenario has no unit '{rest[0]}'{did_you_mean(rest[0], units)}")

    def point(self, settings: Mapping[str, Any], where: str = "", span: Span | None = None) -> Point:
        """The same as a point."""
        return Point(self.scenario(settings, where, span), self.file.parent, dict(settings))

    def planned(
        self, each: Iterable[Settings], common: Mapping[str, Any] | None = None, where: str = ""
    ) -> list["Planned"]:
        """A point for each of these settings, `common` to all of them and to none of their names.

        Settings that are valid by themselves and cannot stand together are no point. InputError for all others.
        """
        found = []
        for settings in each:
            try:
                point = self.point(dict(common or {}) | settings, where)
                found.append(Planned(settings, Point(point.scenario, point.base, settings)))
            except Contradiction as error:
                found.append(Planned(settings, None, error.problem))
        return found


def load_study(path: Path) -> Study:
    """The study in `path`; InputError names the file, the key and the remedy."""
    content = file_content(path, "study", "`name`, `scenario`, `reference` and `lines`", Study)
    return validated(content, Study, str(path))


def plan_study(path: Path, assignments: Iterable[str] = ()) -> Plan:
    """The points of the study in `path`, each with the `assignments` (`key.path=value`) too, to be compared.

    InputError for a key that the scenario does not have, a value that none can have, a line without a valid point, and
    a study without a reference.
    """
    study = load_study(path)
    if not study.references:
        raise InputError(
            f"{path}: the key 'reference' is missing; say what the errors of all points are taken from, the settings "
            "of a finer run such as {coupling.step_ms: 0.1}, or {results: DIR}"
        )
    variants = variants_of(study, path, assignments)
    lines = {line.name: planned_points(variants, line, path) for line in study.lines}
    span = None
    if study.steps is not None:
        scenarios = [planned.point.scenario for line in lines.values() for planned in line if planned.point]
        span = Span.around(scenarios)
    references = [_reference(variants, path, settings, span) for settings in study.references]
    return Plan(study, str(path), references, lines)


def variants_of(study: Study, path: Path, assignments: Iterable[str] = ()) -> Variants:
    """The scenario of the study in `path` with what the study and the `assignments` set for all points.

    InputError where `steps` decides how long runs are, and something else does too.
    """
    common = study.set | parsed_assignments(assignments)
    if study.steps is not None:
        keys = [*common, *(key for line in study.lines for key in (*line.set, *line.vary))]
        keys += [key for reference in study.references for key in reference]
        for key in (STOP, EVERY):
            if key in keys:
                raise InputError(f"{path}: '{key}' is given, and `steps` decides it; remove one of the two")
    return Variants(path.parent / study.scenario, common, str(path), study.steps)


def combinations(vary: Mapping[str, Sequence[Any]]) -> list[Settings]:
    """Every combination of the values, the first key's changing most slowly."""
    return [dict(zip(vary, values, strict=True)) for values in product(*vary.values())]


def stored_reference(path: Path, settings: Settings) -> Reference:
    """The reference `{results: DIR}` of the study in `path`."""
    folder = path.parent / settings["results"]
    return Reference(f"reference: results: {folder}", folder=folder)


def _reference(variants: Variants, path: Path, settings: Settings, span: Span | None) -> Reference:
    if "results" in settings:
        return stored_reference(path, settings)
    try:
        return Reference(f"reference: {told(settings)}", variants.point(settings, "reference", span))
    except Contradiction as error:
        raise InputError(str(error)) from None


def planned_points(variants: Variants, line: Line, path: Path) -> list[Planned]:
    """The points of a line of the study in `path`; InputError where none of them can be run."""
    where = f"lines, '{line.name}'"
    found = variants.planned(combinations(line.vary), line.set, where)
    if all(planned.point is None for planned in found):
        raise InputError(f"{path}: {where}: none of its points can be run, the first because of {found[0].reason}")
    return found
