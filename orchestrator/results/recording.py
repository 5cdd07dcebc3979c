"""A run on its way into its folder: all that is written of it, in the order in which a process may end anywhere."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack, closing
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any

from ..assembly import Assembly
from ..costs import Costs
from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..errors import InputError, Interrupted, RunError, Terminated
from ..omissions import omissions
from ..participants.participant import Implementation
from . import implementation
from .appended import check
from .checkpoint import Checkpoint, Memories
from .coupling_log import CouplingLog, stretches
from .fields import Fields
from .iteration_log import IterationLog
from .names import COUPLING, FMU_LOG, ITERATIONS, PARTS, SUMMARY, TIME_SERIES
from .origin import Origin
from .parts import check_parts
from .profile import Profile
from .recorder import Recorder
from .request import Request
from .summary import write_summary
from .time_series import TimeSeries

#: How a run ended, by the exception that ended it; any other is a crash.
_STATUS: dict[type[BaseException], str] = {
    Terminated: "terminated",
    RunError: "failed",
    InputError: "failed",
    Interrupted: "interrupted",
    KeyboardInterrupt: "interrupted",
}


class Recording:
    """Writes the results of one run while it is entered; on leaving, the summary says how the run ended.

    As long as the summary does not call it done, the checkpoint and what belongs to it stay. A file that cannot be
    completed keeps neither the others nor the summary from it, and hides no error of the run. Refusals of the
    operating system are RunErrors.

    Parameters
    ----------
    before:
        What an earlier process left in the same folder to go on from.
    implementations:
        What the units compute with; empty where they could not be initialised.

    Attributes
    ----------
    summary:
        The content of the summary, once the recording is over.
    diagnosis:
        What is to be told of fields that alternated from step to step, known then.
    """

    def __init__(
        self,
        folder: Path,
        origin: Origin,
        request: Request,
        assembly: Assembly,
        before: Memories | None,
        costs: Costs,
        implementations: Mapping[str, Implementation],
    ) -> None:
        self.summary: dict[str, Any] = {}
        self.diagnosis: list[str] = []
        self._refusal: RunError | None = None
        self._folder, self._origin, self._request, self._assembly = folder, origin, request, assembly
        scenario, participants, master = assembly.scenario, assembly.participants, assembly.master
        self._costs = costs
        self._implementations = implementations
        self._fields: Fields | None = None
        self._iterations: IterationLog | None = None
        # The fields first: a value that is not finite ends the step before the time series has a row of it.
        recorders: dict[str, Recorder] = {}

        def kept(name: str) -> Any:
            return None if before is None else before[name]

        with ExitStack() as opened:

            def add(name: str, recorder: Any) -> Any:
                recorders[name] = opened.enter_context(closing(recorder))
                return recorder

            if assembly.mesh is not None:
                self._fields = add("fields", Fields(folder, participants, assembly.mesh, kept("fields")))
            series = TimeSeries(folder, participants, assembly.probes, kept("series"))
            self._series: TimeSeries = add("series", series)
            converged, adaptive = list(assembly.converged), scenario.coupling.adaptive is not None
            log = CouplingLog(folder, master.units, converged, kept("log"), adaptive, master.growth.names)
            self._log: CouplingLog = add("log", log)
            if converged:
                self._iterations = add("iterations", IterationLog(folder, converged, kept("iterations")))
            self._profile = opened.enter_context(closing(Profile(folder, list(participants))))
            opened.pop_all()
        for participant in participants.values():
            participant.log_to((folder / FMU_LOG).absolute())
        self._recorders = recorders
        memories = {"master": master.memory, "costs": self._costs.memory}
        memories["implementation"] = partial(implementation.memory, implementations)
        memories |= {name: recorder.memory for name, recorder in recorders.items()}
        self._checkpoint = Checkpoint(folder, origin, memories)
        self._every = scenario.run.checkpoint_every
        self._keeps = self._every > 0 and all(participants[unit].abilities.serializes for unit in master.units)

    @staticmethod
    def check(folder: Path, before: Memories) -> None:
        """Raise DamagedFile unless all files that `before` continues from are complete. Nothing is changed."""
        check(folder / TIME_SERIES, before["series"])
        check(folder / COUPLING, before["log"]["table"])
        stretches(before["log"])
        if "iterations" in before:
            check(folder / ITERATIONS, before["iterations"])
        if "fields" in before:
            check_parts(folder / PARTS, int(before["fields"]["frames"]))

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        try:
            for recorder in self._recorders.values():
                recorder.accept(step, exchange)
            self._profile.accept(step, exchange)
            if self._keeps and step.number and step.number % self._every == 0:
                self._checkpoint.write()
        except OSError as error:
            self._refusal = self._refused(error)
            raise self._refusal from error

    def keep(self) -> None:
        """Write a checkpoint of this moment, between two steps, where the units can be kept."""
        try:
            if self._keeps:
                self._checkpoint.write()
        except OSError as error:
            self._refusal = self._refused(error)
            raise self._refusal from error

    def __enter__(self) -> "Recording":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        problems = self._close(error)
        whole = not problems
        ending = self._ending(error, problems)
        done = ending is None
        resumable = self._checkpoint.exists and not done
        if isinstance(error, Interrupted):
            error.resumable = resumable
        master = self._assembly.master
        growth = master.growth.suspected if isinstance(ending, RunError) else master.growth.found
        self.diagnosis = master.diagnosis.paragraphs(growth)
        slower = implementation.fallbacks(self._implementations.values())
        outcome = _outcome(ending) | {
            "unconverged_ms": self._log.unconverged,
            "tolerance_missed": asdict(master.missed),
            "growth": {name: asdict(alternation) for name, alternation in growth.items()},
            "resumable": resumable,
            "warnings": [*self._assembly.warnings, *slower, *self.diagnosis],
            "implementation": implementation.texts(self._implementations),
            "not_modelled": omissions(self._assembly.participants, self._assembly.connections),
            **self._request.content(),
        }
        scenario, costs = self._assembly.scenario, self._costs.content()
        path = self._folder / SUMMARY
        try:
            self.summary = write_summary(path, scenario, self._origin, self._series, costs, outcome)
            if not resumable:
                self._checkpoint.remove()
                # Files that could not be completed may still refer to the frames.
                if self._fields is not None and whole:
                    self._fields.forget()
        except Exception as problem:
            ending = self._ending(ending, [problem])
        if ending is not error and ending is not None:
            raise ending from error

    # --- inside -------------------------------------------------------------------------------------------------------

    def _close(self, error: BaseException | None) -> list[Exception]:
        """Complete all files; what could not be."""
        problems: list[Exception] = []
        calls: list[Callable[[], None]] = [*(recorder.close for recorder in self._recorders.values())]
        calls.append(self._profile.close)
        if isinstance(error, RunError) and error.sweeps is not None and error.time_ms is not None:
            time_ms, sweeps, iterations = error.time_ms, error.sweeps, self._iterations
            if iterations is not None:
                calls.insert(0, lambda: iterations.failed(time_ms, sweeps))
        for call in calls:
            try:
                call()
            except Exception as problem:
                problems.append(problem)
        return problems

    def _ending(self, error: BaseException | None, problems: list[Exception]) -> BaseException | None:
        """What a run ends with that ended with `error` and whose files then had these problems."""
        if isinstance(error, SystemExit):
            # Whatever code it chose: the process is not to end as if the run were done.
            error = RunError(f"something that the run called ended the process (exit code {error.code})")
            error.kind = "unit"
        bugs = [problem for problem in problems if not isinstance(problem, OSError)]
        # Where the operating system has refused once, nobody need be told of every file again.
        if not problems or (error is self._refusal is not None and not bugs):
            return error
        if isinstance(error, RunError):
            besides = RunError(f"{error}; besides, {'; '.join(_told(problem) for problem in problems)}")
            besides.kind, besides.unit, besides.time_ms = error.kind, error.unit, error.time_ms
            return besides
        if error is None or isinstance(error, Interrupted):
            return bugs[0] if bugs else self._refused(problems[0])
        for problem in problems:
            error.add_note(f"besides, {_told(problem)}")
        return error

    def _refused(self, error: Exception) -> RunError:
        rows = self._series.rows
        reached = f". The results up to {rows[-1][0]:g} ms are complete" if rows else ""
        refused = RunError(
            f"the results cannot be written ({_told(error)}){reached}; free space or restore what is missing, "
            "and continue with --resume"
        )
        refused.kind, refused.time_ms = "results", float(rows[-1][0]) if rows else None
        return refused


def _outcome(error: BaseException | None) -> dict[str, Any]:
    """Status and message of a run that ended with `error`, and what failed in one that failed."""
    if error is None:
        return {"status": "done"}
    status = next((status for kind, status in _STATUS.items() if isinstance(error, kind)), None)
    if status is None:
        return {"status": "crashed", "message": f"{type(error).__name__}: {error}"}
    if status == "interrupted":
        return {"status": status}
    failed = {"kind": error.kind, "unit": error.unit, "time_ms": error.time_ms} if isinstance(error, RunError) else None
    return {"status": status, "message": str(error)} | ({} if failed is None else {"failure": failed})


def _told(problem: Exception) -> str:
    if isinstance(problem, OSError) and problem.strerror:
        return f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror
    return f"{type(problem).__name__}: {problem}"
