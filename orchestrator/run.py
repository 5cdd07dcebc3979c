"""A whole run: scenario in, results folder out."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from .checkpoint import Checkpoint, read_checkpoint
from .coupling.build import build_master, build_scheme
from .coupling.connections import connect
from .coupling.master import Observer
from .errors import InputError, Interrupted, RunError
from .participants.native import Mesh, check_mesh, check_unit, fmu_of_unit, scene_mesh
from .participants.participant import Participant
from .participants.recipe import Recipe
from .probes import Probes
from .progress import ProgressBar
from .results.coupling_log import CouplingLog
from .results.fields import Fields
from .results.iteration_log import IterationLog
from .results.profile import Profile
from .results.recorder import Recorder
from .results.summary import write_summary
from .results.time_series import TimeSeries
from .results.writing import remove_stale
from .scenario import Scenario, UnitEntry
from .scene_warnings import scene_warnings
from .show import describe
from .stopping import StopRequest
from .wall_clock import WallClock


@dataclass(frozen=True)
class Outcome:
    """The results folder of a run and its summary."""

    folder: Path
    summary: dict[str, Any]


def run_scenario(
    scenario: Scenario,
    base: Path,
    output: Path,
    console: Console | None = None,
    fmu_dir: Path | None = None,
    resume: bool = False,
) -> Outcome:
    """Run `scenario`, whose paths are relative to `base`, and write the results to `output`.

    Progress goes to `console`; FMUs are taken from `fmu_dir`, or from the user's cache. With `resume` the run goes on
    from the last checkpoint in `output`, if there is one, and ends as if it had never stopped.

    Raises
    ------
    InputError
        Before anything is computed, and before anything in `output` is touched.
    RunError
        When a unit fails; everything up to the last good step is in `output` then.
    Interrupted
        When a signal asked for it.
    """
    started = time.perf_counter()
    if resume and (complete := _complete(output, scenario)) is not None:
        return Outcome(output, complete)
    mesh = checked_mesh(scenario, base)
    probes = None if mesh is None else Probes(mesh, scenario.output.probes_mm)
    warnings = scene_warnings(scenario, mesh)
    if console is not None:
        for text in warnings:
            console.print(f"warning: {text}", markup=False, highlight=False, soft_wrap=True)
    make_folder(output, "--output")
    resumed = read_checkpoint(output, scenario) if resume else None
    with ExitStack() as stack:
        stop = stack.enter_context(StopRequest())
        participants = make_participants(stack, scenario, base, mesh, fmu_dir)
        connections = connect(participants, scenario.connections, scenario.connect_by_name)
        scheme, converged = build_scheme(scenario.coupling, participants, connections)
        master = build_master(scenario, participants, connections, scheme)
        ready = time.perf_counter()
        unready = None
        try:
            if resumed is None:
                master.initialise()
            else:
                master.resume(resumed["master"])
        except RunError as error:
            unready = error
        # Nothing in `output` was touched up to here.
        before = resumed or {}
        recorders: dict[str, Recorder] = {}
        # The fields first: a value that is not finite ends the step before the time series has a row of it.
        fields = None if mesh is None else Fields(output, participants, mesh, before.get("fields"))
        if fields is not None:
            recorders["fields"] = fields
        series = TimeSeries(output, participants, probes, before.get("series"))
        log = CouplingLog(output, master.units, converged, before.get("log"))
        recorders |= {"series": series, "log": log}
        if converged:
            recorders["iterations"] = IterationLog(output, converged, before.get("iterations"))
        for recorder in recorders.values():
            stack.enter_context(closing(recorder))
        profile = stack.enter_context(closing(Profile(output, list(participants))))
        wall = WallClock(master.watch, list(participants), started, ready, before.get("wall"))
        remove_stale(output / "summary.json")
        bar = stack.enter_context(ProgressBar(console or Console(quiet=True), scenario.name, scenario.run.stop_ms))
        memories = {"master": master.memory, "wall": wall.memory}
        memories |= {name: recorder.memory for name, recorder in recorders.items()}
        checkpoint = Checkpoint(output, scenario, scenario.run.checkpoint_every, memories)
        keeps = scenario.run.checkpoint_every > 0 and all(
            participants[unit].abilities.serializes for unit in master.units
        )
        if resumed is None:
            checkpoint.remove()
        outcome: dict[str, Any] = {"status": "interrupted"}
        try:
            if unready is not None:
                raise unready
            observers: list[Observer] = [*recorders.values(), profile, bar, *([checkpoint] if keeps else [])]
            master.run(observers, stop)
            if stop.signal is not None and not master.done:
                if keeps:
                    checkpoint.write()
                raise Interrupted(stop.signal)
            outcome = {"status": "done"}
        except RunError as error:
            outcome = {"status": "failed", "message": str(error)}
            raise
        finally:
            # In this order a process may end anywhere: what the summary calls done is complete, and as long as it does
            # not, the checkpoint and what belongs to it are there.
            for recorder in recorders.values():
                recorder.close()
            resumable = keeps and outcome["status"] != "done"
            outcome |= {"unconverged_ms": log.unconverged, "resumable": resumable, "warnings": warnings}
            summary = write_summary(output / "summary.json", scenario, series, wall.seconds(), outcome)
            if not resumable:
                _forget(checkpoint, fields)
    return Outcome(output, summary)


def show_scenario(scenario: Scenario, base: Path, fmu_dir: Path | None = None) -> str:
    """What `scenario` builds, exchanges and solves, in words; nothing is computed but the mesh."""
    mesh = checked_mesh(scenario, base)
    if mesh is not None:
        Probes(mesh, scenario.output.probes_mm)
    with ExitStack() as stack:
        participants = make_participants(stack, called_directly(scenario), base, mesh, fmu_dir)
        connections = connect(participants, scenario.connections, scenario.connect_by_name)
        scheme, _ = build_scheme(scenario.coupling, participants, connections)
        build_master(scenario, participants, connections, scheme)
        return describe(scenario, mesh, participants, connections)


def called_directly(scenario: Scenario) -> Scenario:
    """The same with units called directly in this process: they show what their FMUs show."""
    run = scenario.run.model_copy(update={"participants": "native", "workers": None})
    return scenario.model_copy(update={"run": run})


def _forget(checkpoint: Checkpoint, fields: Fields | None) -> None:
    checkpoint.remove()
    if fields is not None:
        fields.forget()


def _complete(output: Path, scenario: Scenario) -> dict[str, Any] | None:
    """The summary in `output`, if that is of this scenario, complete."""
    try:
        summary: dict[str, Any] = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    same = summary.get("scenario") == json.loads(json.dumps(scenario.resolved()))
    return summary if same and summary.get("status") == "done" else None


def checked_mesh(scenario: Scenario, base: Path) -> Mesh | None:
    """The mesh of `scenario`, if it has one; InputError for a scene, unit or parameter that does not exist."""
    for name, entry in scenario.units.items():
        if entry.unit is not None:
            with _naming(f"units.{name}"):
                check_unit(entry.unit, entry.parameters)
    if scenario.scene is None:
        return None
    with _naming("scene"):
        mesh = scene_mesh(scenario.scene, base)
        units = [entry.unit for entry in scenario.units.values() if entry.unit is not None]
        check_mesh(mesh, scenario.scene, base, units)
    return mesh


def make_participants(
    stack: ExitStack, scenario: Scenario, base: Path, mesh: Mesh | None, fmu_dir: Path | None = None
) -> dict[str, Participant]:
    """All participants, in this process or in workers, closed with the `stack`."""
    if fmu_dir is not None:
        make_folder(fmu_dir, "--fmu-dir")
    make: Callable[[Recipe], Participant] = Recipe.make
    if scenario.run.workers is not None:
        # Imported here: who works alone need not wait for it.
        from .participants.workers import Workers

        workers = Workers(scenario.run.workers, len(scenario.units), scenario.run.unit_time_limit_s)
        make = stack.enter_context(workers).make
    participants = {}
    for name, entry in scenario.units.items():
        recipe = _recipe(name, entry, scenario, base, mesh, fmu_dir)
        participants[name] = stack.enter_context(closing(make(recipe)))
    return participants


def _recipe(
    name: str, entry: UnitEntry, scenario: Scenario, base: Path, mesh: Mesh | None, fmu_dir: Path | None
) -> Recipe:
    parameters, ramps = dict(entry.parameters), scenario.coupling.interpolation == "linear"
    if entry.fmu is not None:
        return Recipe(name, parameters, ramps, fmu=base / entry.fmu, start=dict(entry.start))
    if mesh is None or entry.unit is None:
        raise TypeError("a scenario without a scene has FMUs only")
    if scenario.run.participants == "native":
        return Recipe(name, parameters, ramps, unit=entry.unit, mesh=mesh)
    fmi = 3 if scenario.run.participants == "fmu3" else 2
    return Recipe(name, parameters, ramps, fmu=fmu_of_unit(entry.unit, mesh, fmu_dir, fmi))


def make_folder(folder: Path, option: str) -> None:
    """Make sure that files can be written to `folder`; InputError names the `option` that chooses another."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            f"the folder {folder} cannot be written ({error.strerror}); choose another with {option}"
        ) from None


@contextmanager
def _naming(key: str) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
