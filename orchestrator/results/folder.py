"""The folder of a run: one run at a time, of one origin, and with nothing in it that belongs to another."""

import csv
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from ..assembly import Assembly
from ..costs import Costs
from ..errors import InputError
from ..participants.participant import Implementation
from ..writing import allowed, remove_stale, writing
from .checkpoint import Memories, read_checkpoint
from .hdf5 import DamagedFile
from .lock import FolderLock
from .names import (
    BUDGET,
    CHECKPOINT,
    COUPLING,
    FIELDS,
    FMU_LOG,
    GROWING,
    ITERATIONS,
    PAGE,
    PARTS,
    SUMMARY,
    TIME_SERIES,
    WHOLE,
    XDMF,
)
from .origin import Origin
from .recording import Recording
from .request import Request
from .summary import is_summary
from .whole import reserve, unfinished

#: Space in bytes that is kept for the summary: a run that ends because the disk is full is to say so.
_RESERVE = 16384

_REMEDY = "run without --resume to start again"


class ResultsFolder:
    """While entered, no other run writes to the folder; InputError if one does, or if nothing can be written there."""

    def __init__(self, path: Path, origin: Origin, request: Request) -> None:
        self.path = path
        self._origin = origin
        self._request = request
        self._lock: FolderLock | None = None

    def __enter__(self) -> "ResultsFolder":
        self._lock = FolderLock(self.path)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._lock is not None:
            self._lock.release()

    def complete(self) -> dict[str, Any] | None:
        """The summary, if a run of this scenario is complete here; what a killed process left beside it is removed.

        InputError if it is of other files or of another program, or if its results are not there any more.
        """
        path = self.path / SUMMARY
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["status"] != "done" or content["scenario"] != self._origin.scenario:
                return None
        # Not there, or not ours.
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        try:
            before = Origin.from_content(content)
        except ValueError:
            raise InputError(f"{path}: this run is complete, but was made by another version; {_REMEDY}") from None
        for change in self._origin.changes(before):
            raise InputError(f"{path}: this run is complete, but {change}, or {_REMEDY}")
        if not is_summary(content) or not self._holds(content["steps"]):
            raise InputError(
                f"{path}: this run is complete, but some of its results were changed afterwards; {_REMEDY}"
            )
        with allowed(self.path, "--output"):
            self._remove_leftovers()
            (self.path / CHECKPOINT).unlink(missing_ok=True)
            self._remove_parts()
        return dict(content)

    def checkpoint(self) -> Memories | None:
        """What a run of this origin can go on from; None if there is nothing. InputError if it is of another."""
        return read_checkpoint(self.path, self._origin)

    @contextmanager
    def fitting(self) -> Iterator[None]:
        """For code that uses a checkpoint: content that does not fit becomes an InputError."""
        try:
            yield
        except DamagedFile as error:
            raise InputError(f"{error.filename}: it was changed after the run wrote it; {_REMEDY}") from None
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"{self.path / CHECKPOINT}: the checkpoint does not fit this run ({type(error).__name__}: {error}); "
                f"{_REMEDY}"
            ) from error

    def record(
        self,
        assembly: Assembly,
        before: Memories | None,
        costs: Costs,
        implementations: Mapping[str, Implementation],
    ) -> Recording:
        """Open the files of a run, or go on with those of one that left `before`; see Recording."""
        self._check_places()
        if before is not None:
            with self.fitting():
                Recording.check(self.path, before)
        with writing(self.path / SUMMARY):
            self._remove_leftovers()
        try:
            with writing(self.path / SUMMARY):
                reserve(self.path / SUMMARY, _RESERVE)
            return self._opened(assembly, before, costs, implementations)
        except BaseException:
            with suppress(OSError):
                self._remove_leftovers()
            raise

    # --- inside -------------------------------------------------------------------------------------------------------

    def _opened(
        self,
        assembly: Assembly,
        before: Memories | None,
        costs: Costs,
        implementations: Mapping[str, Implementation],
    ) -> Recording:
        # First what would let the rest pass for the result of an earlier run.
        for name in (SUMMARY, PAGE, *BUDGET):
            remove_stale(self.path / name)
        if before is None:
            remove_stale(self.path / CHECKPOINT)
            remove_stale(self.path / FMU_LOG)
        if not assembly.converged:
            remove_stale(self.path / ITERATIONS)
        if assembly.mesh is None:
            for name in (FIELDS, XDMF):
                remove_stale(self.path / name)
            with writing(self.path / PARTS):
                self._remove_parts()
        with allowed(self.path, "--output"), nullcontext() if before is None else self.fitting():
            return Recording(self.path, self._origin, self._request, assembly, before, costs, implementations)

    def _check_places(self) -> None:
        """InputError where something is in the way of a file, before any is touched."""
        for name in (*GROWING, *WHOLE):
            path = self.path / name
            with writing(path):
                if path.is_dir() or (name in GROWING and path.exists()):
                    path.open("ab").close()

    def _remove_leftovers(self) -> None:
        """Remove what was being written, or reserved, when a process was killed."""
        for name in WHOLE:
            unfinished(self.path / name).unlink(missing_ok=True)

    def _remove_parts(self) -> None:
        if (self.path / PARTS).exists():
            shutil.rmtree(self.path / PARTS)

    def _holds(self, steps: int) -> bool:
        """Whether the results of so many steps are there."""
        names = [TIME_SERIES, COUPLING, *([FIELDS, XDMF] if "scene" in self._origin.scenario else [])]
        if not all((self.path / name).is_file() for name in names):
            return False
        with (self.path / TIME_SERIES).open(newline="", encoding="utf-8", errors="replace") as file:
            try:
                return sum(1 for _ in csv.reader(file)) == steps + 2
            except csv.Error:
                return False
