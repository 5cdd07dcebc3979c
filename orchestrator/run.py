"""A whole run: scenario in, results folder out."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console
from threadpoolctl import threadpool_limits

from .alarm import Alarm
from .assembly import assemble, checked_mesh
from .costs import Costs
from .coupling.master import Observer
from .drawing import Drawing
from .errors import InputError, Interrupted, RunError
from .participants.native import Mesh
from .progress import RunProgress
from .results import implementation
from .results.folder import ResultsFolder
from .results.origin import Origin
from .scenario import Scenario
from .showing import assembled, describe
from .stopping import StopRequest

#: From a scenario, and the folder that its paths are relative to, to its mesh, if it has one.
MeshOf = Callable[[Scenario, Path], Mesh | None]


@dataclass(frozen=True)
class Outcome:
    """The results folder of a run and its summary; `warnings` tell what is wrong with it, or was not done beside."""

    folder: Path
    summary: dict[str, Any]
    warnings: tuple[str, ...] = ()


def run_scenario(
    scenario: Scenario,
    base: Path,
    output: Path,
    console: Console | None = None,
    fmu_dir: Path | None = None,
    resume: bool = False,
    figures: bool = False,
    mesh_of: MeshOf = checked_mesh,
    progress: bool = True,
) -> Outcome:
    """Run `scenario`, whose paths are relative to `base`, and write the results to `output`.

    Warnings go to `console`, and so does the `progress`, unless nobody wants to see it. FMUs are taken from `fmu_dir`,
    or from the user's cache. With `resume` the run goes on from the last checkpoint in `output`, if there is one, and
    ends as if it had never stopped. `figures` are drawn when it is done. `mesh_of` gives the scenario's mesh: whoever
    runs many scenarios on one mesh may have kept it.

    Raises
    ------
    InputError
        Before anything is computed, and before anything in `output` is touched.
    RunError
        When a unit fails, or the operating system refuses to write; everything up to the last good step is in
        `output` then.
    Interrupted
        When a signal asked for it.
    """
    started = time.perf_counter()
    console = console or Console(quiet=True)
    with ResultsFolder(output, Origin.of(scenario, base)) as folder, ExitStack() as stack:
        # The units' vectors are short: BLAS's threads cost more than they bring, many times as much where several
        # processes share the cores, and the bits of a sum depend on their number.
        stack.enter_context(threadpool_limits(limits=1))
        drawing = stack.enter_context(Drawing(output)) if figures else None
        summary = folder.complete() if resume else None
        if summary is None:
            outcome = _run(folder, scenario, base, console, fmu_dir, resume, started, drawing, mesh_of, progress)
        else:
            outcome = Outcome(output, summary)
            if drawing is not None:
                drawing.begin()
        if drawing is None:
            return outcome
        with (console if progress else Console(quiet=True)).status("drawing the figures"):
            return replace(outcome, warnings=(*outcome.warnings, *drawing.finish()))


def _run(
    folder: ResultsFolder,
    scenario: Scenario,
    base: Path,
    console: Console,
    fmu_dir: Path | None,
    resume: bool,
    started: float,
    drawing: Drawing | None,
    mesh_of: MeshOf,
    progress: bool,
) -> Outcome:
    before = folder.checkpoint() if resume else None
    mesh = mesh_of(scenario, base)
    with ExitStack() as stack:
        stop = stack.enter_context(StopRequest())
        assembly = assemble(stack, scenario, base, mesh, fmu_dir)
        _warn(console, assembly.warnings)
        master = assembly.master
        ready = time.perf_counter()
        unready = None
        with folder.fitting() if before is not None else nullcontext():
            kept = None if before is None else before["costs"]
            costs = Costs(master, list(assembly.participants), started, ready, kept)
        try:
            if before is None:
                master.initialise()
            else:
                with folder.fitting():
                    master.resume(before["master"])
            implementations = implementation.implementations(assembly.participants)
        except RunError as error:
            if before is not None:
                raise InputError(f"{folder.path}: {error}; run without --resume to begin anew") from error
            unready, implementations = error, {}
        if before is not None:
            with folder.fitting(), _about(folder.path):
                implementation.check(before["implementation"], implementations)
        _warn(console, implementation.fallbacks(implementations.values()))
        # Nothing in the folder was touched up to here.
        recording = folder.record(assembly, before, costs, implementations)
        bar = RunProgress(console if progress else Console(quiet=True), scenario.name, scenario.run.stop_ms)
        with recording, bar:
            if unready is not None:
                raise unready
            observers: list[Observer] = [recording, bar, Alarm(master.growth, master.diagnosis, console)]
            master.run([*observers, drawing] if drawing is not None else observers, stop)
            if stop.signal is not None and not master.done:
                recording.keep()
                raise Interrupted(stop.signal)
        # All results are there; the participants are closed while the figures are drawn.
        if drawing is not None:
            drawing.begin()
    return Outcome(folder.path, recording.summary, tuple(recording.diagnosis))


def _warn(console: Console, warnings: Iterable[str]) -> None:
    for text in warnings:
        console.print(f"warning: {text}", markup=False, highlight=False, soft_wrap=True)


@contextmanager
def _about(path: Path) -> Iterator[None]:
    """Put the folder in front of what is wrong with what is in it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def show_scenario(scenario: Scenario, base: Path, fmu_dir: Path | None = None) -> str:
    """What `scenario` builds, exchanges and solves, in words; nothing is computed but the mesh."""
    with assembled(scenario, base, fmu_dir) as assembly:
        return describe(assembly)
