"""What the value references of a call mean: which variables, which of their values, and where those stand.

In FMI 2.0 a reference is one scalar; in FMI 3.0 it is a whole variable, whose values follow one another.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from ..units.errors import InvalidInput
from .layout import TIME, Run


class Piece(NamedTuple):
    """A variable, or some of its values.

    `places` are theirs within the variable, in row-major order; None means all of them, in that order. `at` is where
    they stand among the values that cross with the call.
    """

    run: Run
    places: np.ndarray | None
    at: slice | np.ndarray

    @property
    def size(self) -> int:
        """How many values."""
        return self.run.size if self.places is None else len(self.places)


class References(Protocol):
    """The value references of one version of FMI; InvalidInput for those that do not exist."""

    def pieces(self, references: np.ndarray) -> Sequence[Piece]:
        """What `references` mean."""


class ScalarReferences:
    """Those of FMI 2.0."""

    def __init__(self, unit: str, runs: Sequence[Run]) -> None:
        self._unit, self._runs = unit, runs
        self._firsts = np.array([run.first for run in runs])
        self._end = runs[-1].first + runs[-1].size
        self._whole = {(run.first, run.size): [Piece(run, None, slice(None))] for run in runs}
        # Compared with at every call: in the type in which they come, and made once.
        self._ranges = {key: np.arange(key[0], sum(key), dtype=np.uint32) for key in self._whole}

    def pieces(self, references: np.ndarray) -> Sequence[Piece]:
        """See References."""
        if not len(references):
            return []
        key = int(references[0]), len(references)
        if key in self._whole and np.array_equal(references, self._ranges[key]):
            return self._whole[key]
        if references.max() >= self._end:
            raise InvalidInput(f"unit '{self._unit}' has no value reference {references.max()}")
        owner = np.searchsorted(self._firsts, references, side="right") - 1
        found = []
        for number in np.unique(owner):
            run, at = self._runs[number], np.flatnonzero(owner == number)
            found.append(Piece(run, references[at].astype(np.int64) - run.first, at))
        return found


class ArrayReferences:
    """Those of FMI 3.0."""

    def __init__(self, unit: str, runs: Sequence[Run]) -> None:
        self._unit = unit
        self._runs = {run.reference: run for run in (TIME, *runs)}

    def pieces(self, references: np.ndarray) -> Sequence[Piece]:
        """See References."""
        found, end = [], 0
        for reference in references.tolist():
            if reference not in self._runs:
                raise InvalidInput(f"unit '{self._unit}' has no value reference {reference}")
            run = self._runs[reference]
            found.append(Piece(run, None, slice(end, end + run.size)))
            end += run.size
        return found
