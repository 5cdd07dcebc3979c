"""The states of several units at one moment, kept in order to return to them."""

from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Any

from ..errors import ParticipantError
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
        failure: ParticipantError | None = None
        while self._states:
            unit, state = self._states.popitem()
            try:
                with blaming(unit):
                    self._participants[unit].free(state)
            except ParticipantError as refused:
                failure = failure or refused
        # A unit that has failed may refuse this as well; why it failed is what a person wants to know.
        if failure is not None and error is None:
            raise failure
