"""From a scenario to a master with all it couples, ready to be initialised."""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from .coupling.build import build_master, build_scheme
from .coupling.connections import Connection, connect
from .coupling.master import Master
from .coupling.stand_ins import check_stand_ins
from .errors import InputError, ParticipantError, RunError
from .fmu_folder import FmuFolder
from .participants.driven import drive
from .participants.native import Mesh, check_mesh, check_unit, scene_mesh
from .participants.participant import Participant
from .participants.recipe import Recipe
from .participants.recorded import recorded
from .probes import Probes
from .scenario import Scenario, UnitEntry
from .scene_warnings import scene_warnings

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class Assembly:
    """The master of a scenario with all that it couples; `warnings` name what is unusual of the scenario.

    `converged` says of each field ("unit.field") that has to converge in an iterated step by which criterion.
    """

    scenario: Scenario
    mesh: Mesh | None
    probes: Probes | None
    participants: Mapping[str, Participant]
    connections: Sequence[Connection]
    converged: Mapping[str, str]
    master: Master
    warnings: Sequence[str]


def assemble(
    stack: ExitStack,
    scenario: Scenario,
    base: Path,
    mesh: Mesh | None,
    fmu_dir: Path | None = None,
    described: bool = False,
) -> Assembly:
    """Put `scenario` together, whose paths are relative to `base` and whose mesh is `mesh` (`checked_mesh`).

    What is only `described` runs no code of foreign FMUs, and cannot be initialised. The participants are closed with
    the `stack`. FMUs are built in `fmu_dir`, or in the user's cache. InputError for whatever does not fit.
    """
    probes = None if mesh is None else Probes(mesh, scenario.output.probes_mm)
    participants = make_participants(stack, scenario, base, mesh, fmu_dir, described)
    connections = connect(participants, scenario.connections, scenario.connect_by_name)
    check_stand_ins(participants, connections, {name: entry.start for name, entry in scenario.units.items()})
    if scenario.inputs is not None:
        connected = [(link.target.unit, link.target.name) for link in connections]
        ramps = scenario.coupling.interpolation == "linear"
        participants = drive(participants, connected, base / scenario.inputs.file, ramps)
    recorded(participants)
    scheme, converged = build_scheme(scenario.coupling, participants, connections)
    master = build_master(scenario, participants, connections, scheme)
    return Assembly(scenario, mesh, probes, participants, connections, converged, master, _warnings(scenario, mesh))


def _warnings(scenario: Scenario, mesh: Mesh | None) -> list[str]:
    warnings = scene_warnings(scenario, mesh)
    adaptive = scenario.coupling.adaptive
    if scenario.inputs is not None and adaptive is not None:
        warnings.append(
            f"coupling.adaptive does not see how the signals in {scenario.inputs.file} change within a step; keep "
            f"`max_ms` ({adaptive.max_ms:g} ms) well below the time scale of these changes"
        )
    return warnings


def called_directly(scenario: Scenario) -> Scenario:
    """The same with units called directly in this process: they show what their FMUs show."""
    run = scenario.run.model_copy(update={"participants": "native", "workers": None})
    return scenario.model_copy(update={"run": run})


def checked_mesh(scenario: Scenario, base: Path) -> Mesh | None:
    """The mesh of `scenario`, if it has one; InputError for a scene, unit or parameter that does not exist."""
    check_units(scenario)
    if scenario.scene is None:
        return None
    with _naming("scene"):
        mesh = scene_mesh(scenario.scene, base)
        units = [entry.unit for entry in scenario.units.values() if entry.unit is not None]
        check_mesh(mesh, scenario.scene, base, units)
    _LOG.info("mesh: %s nodes, %s elements", mesh.nodes, mesh.elements)
    return mesh


def check_units(scenario: Scenario) -> None:
    """InputError for a unit or a parameter that does not exist, and for a parameter's value that is out of range."""
    for name, entry in scenario.units.items():
        if entry.unit is not None:
            with _naming(f"units.{name}"):
                check_unit(entry.unit, entry.parameters)


def make_participants(
    stack: ExitStack,
    scenario: Scenario,
    base: Path,
    mesh: Mesh | None,
    fmu_dir: Path | None = None,
    described: bool = False,
) -> dict[str, Participant]:
    """All participants, in this process or in workers, closed with the `stack`; or `described` only."""
    fmus = FmuFolder(stack, fmu_dir)
    make: Callable[[Recipe], Participant] = Recipe.describe if described else Recipe.make
    if scenario.run.workers is not None:
        # Imported here: who works alone need not wait for it.
        from .participants.workers import Workers

        workers = Workers(scenario.run.workers, len(scenario.units), scenario.run.unit_time_limit_s)
        make = stack.enter_context(workers).make
    participants = {}
    for name, entry in scenario.units.items():
        recipe = _recipe(name, entry, scenario, base, mesh, fmus)
        try:
            participants[name] = stack.enter_context(_closing(make(recipe)))
        # A foreign FMU that may not be read, or no place to unpack one.
        except OSError as error:
            place = f" ({error.filename})" if error.filename else ""
            raise InputError(
                f"unit '{name}' cannot be set up: {error.strerror or error}{place}; check the permissions and the "
                "space left there, and in the folder for temporary files (TMPDIR)"
            ) from None
    return participants


def _recipe(name: str, entry: UnitEntry, scenario: Scenario, base: Path, mesh: Mesh | None, fmus: FmuFolder) -> Recipe:
    parameters = dict(entry.parameters)
    observe = scenario.observed(name)
    if entry.fmu is not None:
        return Recipe(name, parameters, fmu=base / entry.fmu, start=dict(entry.start), observe=observe)
    if mesh is None or entry.unit is None:
        raise TypeError("a scenario without a scene has FMUs only")
    if scenario.run.participants == "native":
        return Recipe(name, parameters, unit=entry.unit, mesh=mesh, observe=observe)
    fmi = 3 if scenario.run.participants == "fmu3" else 2
    return Recipe(name, parameters, fmu=fmus.fmu(entry.unit, mesh, fmi), observe=observe)


@contextmanager
def _closing(participant: Participant) -> Iterator[Participant]:
    """Close `participant` in the end; where that fails, it hides no other failure."""
    try:
        yield participant
    except BaseException as error:
        try:
            participant.close()
        except Exception as problem:
            error.add_note(f"besides, unit '{participant.name}' could not be closed: {problem}")
        raise
    try:
        participant.close()
    except ParticipantError as error:
        raise RunError(f"unit '{participant.name}' could not be closed after the run: {error}") from error


@contextmanager
def _naming(key: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
