"""Participants that work at the same time: each an actor of Dask's, in a thread or a process of its own, or elsewhere.

A process costs about a millisecond per call, and its death takes nobody else along. On other machines this project has
to be installed in the same version; FMUs are sent there.
"""

from collections.abc import Callable
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from types import TracebackType
from typing import Any

from distributed.actor import ActorFuture
from threadpoolctl import threadpool_limits

from ..cluster import Cluster
from ..errors import InputError, ParticipantError, ParticipantLost
from ..stopwatch import Moment, Usage
from .participant import Abilities, Implementation, Participant, Ports, Ramp, Values, Wait
from .recipe import Recipe

#: How long to wait for a scheduler, or for an actor to be set up, in seconds.
_PATIENCE_S = 300.0


class Workers:
    """Where actors are made, one worker for each of `count`; `where` is `threads`, `processes` or an address."""

    def __init__(self, where: str, count: int, limit_s: float | None) -> None:
        self._where = where
        self._limit_s = limit_s
        self._cluster = Cluster(where, count, "run.workers")
        # Units share workers only where there are fewer workers than units.
        self._next = cycle(self._cluster.workers)

    def make(self, recipe: Recipe) -> Participant:
        """The participant of `recipe`, in the next worker."""
        sent = recipe if self._cluster.is_ours else recipe.portable()
        address = next(self._next)
        apart = self._where != "threads"
        future = self._cluster.client.submit(_Host, sent, apart, actor=True, workers=[address], pure=False)
        try:
            actor = future.result(timeout=_PATIENCE_S)
        except InputError:
            raise
        except Exception as error:
            raise InputError(f"run.workers: unit '{recipe.name}' could not be set up at {address}: {error}") from None
        return RemoteParticipant(recipe.name, actor, self._limit_s)

    def __enter__(self) -> "Workers":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._cluster.__exit__(kind, error, trace)


class _Host:
    """The actor: holds the participant where it works, and its saved states, which stay there.

    `apart`: that is another process than the master's.
    """

    def __init__(self, recipe: Recipe, apart: bool) -> None:
        self._participant = recipe.make()
        self._apart = apart
        # As where the master works, whoever started this process.
        threadpool_limits(limits=1)
        self._states: dict[int, Any] = {}
        self._saved = 0

    def describe(self) -> tuple[Ports, Ports, Ports, Abilities]:
        participant = self._participant
        return participant.inputs, participant.outputs, participant.observed, participant.abilities

    def call(self, name: str, *arguments: Any) -> Any:
        return getattr(self._participant, name)(*arguments)

    def begin(self) -> Usage:
        return self._measured(self._participant.begin)

    def complete(self) -> Usage:
        return self._measured(self._participant.complete)

    def step(self, time: float, size: float) -> Usage:
        return self._measured(lambda: self._participant.start(time, size)())

    def _measured(self, call: Callable[[], object]) -> Usage:
        begun = Moment.now()
        try:
            call()
        except ParticipantError as error:
            error.usage = begun.used(self._apart)
            raise
        return begun.used(self._apart)

    def save(self) -> int:
        self._saved += 1
        self._states[self._saved] = self._participant.save()
        return self._saved

    def restore(self, number: int) -> None:
        self._participant.restore(self._states[number])

    def free(self, number: int) -> None:
        self._participant.free(self._states.pop(number))


class RemoteParticipant:
    """Stands for a participant in another thread, process or machine. A step is started there and waited for here."""

    def __init__(self, name: str, actor: Any, limit_s: float | None) -> None:
        self.name = name
        self._actor = actor
        self._limit_s = limit_s
        self.inputs, self.outputs, self.observed, self.abilities = self._result(actor.describe())

    def begin(self) -> Usage:
        """See Participant."""
        usage: Usage = self._result(self._ask("begin"))
        return usage

    def complete(self) -> Usage:
        """See Participant."""
        usage: Usage = self._result(self._ask("complete"))
        return usage

    def set(self, name: str, values: Values) -> None:
        """See Participant."""
        self._call("set", name, values)

    def ramp(self, name: str, ramp: Ramp) -> None:
        """See Participant."""
        self._call("ramp", name, ramp)

    def get(self, name: str) -> Values:
        """See Participant."""
        values: Values = self._call("get", name)
        return values

    def start(self, time: float, size: float) -> Wait:
        """See Participant."""
        future = self._ask("step", time, size)
        return lambda: self._result(future)

    def save(self) -> int:
        """See Participant; the state stays where it is, and has a number here."""
        return int(self._result(self._ask("save")))

    def restore(self, state: int) -> None:
        """See Participant."""
        self._result(self._ask("restore", state))

    def free(self, state: int) -> None:
        """See Participant; a worker that is lost has lost its states as well."""
        with suppress(ParticipantLost):
            self._result(self._ask("free", state))

    def pack(self) -> bytes:
        """See Participant."""
        return bytes(self._call("pack"))

    def unpack(self, data: bytes) -> None:
        """See Participant."""
        self._call("unpack", data)

    def implementation(self) -> Implementation:
        """See Participant; of the worker's machine."""
        told: Implementation = self._call("implementation")
        return told

    def log_to(self, path: Path) -> None:
        """See Participant; the file is on the worker's machine."""
        self._call("log_to", path)

    def close(self) -> None:
        """See Participant."""
        with suppress(ParticipantError):
            self._call("close")

    def _call(self, name: str, *arguments: Any) -> Any:
        return self._result(self._ask("call", name, *arguments))

    def _ask(self, method: str, *arguments: Any) -> ActorFuture[Any]:
        try:
            return getattr(self._actor, method)(*arguments)
        # What Dask raises of an actor whose worker is known to be gone.
        except (RuntimeError, OSError) as error:
            raise self._lost() from error

    def _result(self, future: ActorFuture[Any]) -> Any:
        try:
            return future.result(timeout=self._limit_s)
        except (ParticipantError, InputError):
            raise
        except TimeoutError as error:
            if self._limit_s is None:
                raise self._lost() from error
            raise ParticipantLost(
                f"it did not return within {self._limit_s:g} s (run.unit_time_limit_s); "
                "raise the limit if its steps can take that long"
            ) from error
        except (RuntimeError, OSError) as error:
            raise self._lost() from error

    @staticmethod
    def _lost() -> ParticipantLost:
        return ParticipantLost("its process ended unexpectedly; its last output may say why")
