"""The states of several units at one moment, kept to go back to."""

from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Any

from ..participants.participant import Participant
from .exchange import blaming


class Rollback:
    """Saves the states of `units` when entered and gives them up when left."""

    def __init__(self, participants: Mapping[str, Participant], units: Iterable[str]) -> None:
        self._participants = participants
        self._units = tuple(units)
        self._states: dict[str, Any] = {}

    def __enter__(self) -> "Rollback":
        try:
            for unit in self._units:
                with blaming(unit):
                    self._states[unit] = self._participants[unit].save()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def restore(self) -> None:
        """Take all units back."""
        for unit, state in self._states.items():
            with blaming(unit):
                self._participants[unit].restore(state)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._states:
            unit, state = self._states.popitem()
            self._participants[unit].free(state)
