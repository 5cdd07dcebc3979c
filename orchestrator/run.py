"""A whole run: scenario in, results folder out."""

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console
from threadpoolctl import threadpool_limits

from .alarm import Alarm
from .assembly import assemble, checked_mesh
from .costs import Costs
from .coupling.master import Observer
from .errors import InputError, Interrupted, RunError
from .participants.native import Mesh
from .progress import RunProgress
from .results import implementation
from .results.folder import ResultsFolder
from .results.names import SUMMARY
from .results.origin import Origin
from .results.request import Request
from .scenario import Scenario
from .showing import assembled, describe
from .stopping import StopRequest

#: From a scenario, and the folder that its paths are relative to, to its mesh, if it has one.
MeshOf = Callable[[Scenario, Path], Mesh | None]


@dataclass(frozen=True)
class Outcome:
    """The results folder of a run and its summary; `warnings` name what is wrong with it, or could not be done."""

    folder: Path
    summary: dict[str, Any]
    warnings: tuple[str, ...] = ()


class Companion(AbstractContextManager["Companion"], Observer, Protocol):
    """Makes figures and reports of a run's results, beside the run and after it (`report.presentation`)."""

    def begin(self) -> None:
        """All results are complete: start to make figures and reports of them; `finish` waits for these."""

    def finish(self) -> tuple[str, ...]:
        """Wait for what `begin` started; the warnings name what could not be made."""


def run_scenario(
    scenario: Scenario,
    base: Path,
    output: Path,
    console: Console | None = None,
    fmu_dir: Path | None = None,
    resume: bool = False,
    companion: Companion | None = None,
    request: Request | None = None,
    mesh_of: MeshOf = checked_mesh,
    progress: bool = True,
) -> Outcome:
    """Run `scenario`, whose paths are relative to `base`, and write the results to `output`.

    Warnings go to `console`, and so does the `progress`, unless nobody wants to see it. FMUs are taken from `fmu_dir`,
    or from the user's cache. With `resume` the run goes on from the last checkpoint in `output`, if there is one, and
    ends as if it had never stopped. The `companion` presents the results, also those up to a failure. `request` is kept
    in the summary. `mesh_of` gives the scenario's mesh: whoever runs many scenarios on one mesh may have kept it.

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
    request = request or Request()
    with ResultsFolder(output, Origin.of(scenario, base), request) as folder, ExitStack() as stack:
        # The units' vectors are short: BLAS's threads cost more than they bring, many times as much where several
        # processes share the cores, and the bits of a sum depend on their number.
        stack.enter_context(threadpool_limits(limits=1))
        if companion is not None:
            stack.enter_context(companion)
        summary = folder.complete() if resume else None
        if summary is None:
            try:
                outcome = _run(folder, scenario, base, console, fmu_dir, resume, started, companion, mesh_of, progress)
            except RunError as error:
                # What led to the failure is what one wants to look at.
                if companion is not None and (output / SUMMARY).exists():
                    companion.begin()
                    _warn(console, _finished(companion, console, progress, error))
                raise
        else:
            outcome = Outcome(output, summary)
            if companion is not None:
                companion.begin()
        if companion is None:
            return outcome
        return replace(outcome, warnings=(*outcome.warnings, *_finished(companion, console, progress)))


def _finished(
    companion: Companion, console: Console, progress: bool, failure: RunError | None = None
) -> tuple[str, ...]:
    """The warnings of what was begun; a bug in it does not hide the `failure` of the run."""
    try:
        with (console if progress else Console(quiet=True)).status("drawing the results"):
            return companion.finish()
    except Exception as error:
        if failure is None:
            raise
        return (str(error),)


def _run(
    folder: ResultsFolder,
    scenario: Scenario,
    base: Path,
    console: Console,
    fmu_dir: Path | None,
    resume: bool,
    started: float,
    companion: Companion | None,
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
                raise InputError(f"{folder.path}: {error}; run without --resume to start again") from error
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
            master.run([*observers, companion] if companion is not None else observers, stop)
            if stop.signal is not None and not master.done:
                recording.keep()
                raise Interrupted(stop.signal)
        # All results are there; the participants are closed while they are presented.
        if companion is not None:
            companion.begin()
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
