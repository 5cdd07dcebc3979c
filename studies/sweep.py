"""A sweep: a scenario with every combination of some values, each run once; it needs no reference and no study file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..orchestrator.errors import InputError
from ..orchestrator.quoting import shortened
from ..orchestrator.untrusted.yaml_text import parse_yaml
from .bench import Bench
from .plan import Planned, Variants, combinations
from .point import told
from .trial import Trial

#: More runs than this are a slip of the pen.
_MOST_RUNS = 10_000

#: Characters of an argument that a message repeats.
_LONGEST = 200


@dataclass(frozen=True)
class Swept:
    """What came of a point: `trial` is None where the settings cannot stand together, and `reason` says why."""

    settings: Mapping[str, Any]
    trial: Trial | None
    reason: str = ""

    @property
    def name(self) -> str:
        """What the run is called."""
        return told(self.settings)

    @property
    def status(self) -> str:
        """As a trial has it."""
        return "refused" if self.trial is None else self.trial.status


def varied_values(arguments: Sequence[str]) -> dict[str, list[Any]]:
    """The values by key of arguments `key.path=a,b,c`; InputError for one that is not of that form.

    Values are read as YAML, so that `{tolerance: 0.1}`, `null` and `[1, 2]` are each one value.
    """
    vary: dict[str, list[Any]] = {}
    for argument in arguments:
        key, separator, text = (part.strip() for part in argument.partition("="))
        shown = shortened(argument, _LONGEST)
        if not key or not separator or not text:
            raise InputError(f"{shown}: write what is varied as key.path=value,value, e.g. coupling.step_ms=1,2.5,5")
        if key in vary:
            raise InputError(f"{shown}: '{shortened(key)}' is varied twice; give all its values at once")
        try:
            values = parse_yaml(f"[{text}]")
        except ValueError as error:
            raise InputError(f"{shown}: the values are {error}") from None
        if not isinstance(values, list) or not values:
            raise InputError(f"{shown}: there are no values; write {shortened(key)}=value,value")
        vary[key] = values
    if not vary:
        raise InputError("nothing is varied; add at least one key with its values, e.g. coupling.step_ms=1,2.5,5")
    return vary


def plan_sweep(variants: Variants, vary: Mapping[str, Sequence[Any]]) -> list[Planned]:
    """Every combination of the values as a point, checked before anything runs.

    InputError for a key that there is not, for a value that it cannot have, where no combination can be run, and for
    more runs than anybody waits for.
    """
    count = 1
    for values in vary.values():
        count *= len(values)
    if count > _MOST_RUNS:
        raise InputError(f"{variants.file}: the values make {count} runs; at most {_MOST_RUNS} are run, so give fewer")
    planned = variants.planned(combinations(vary))
    if all(each.point is None for each in planned):
        raise InputError(f"{variants.file}: none of the runs is possible, the first because of {planned[0].reason}")
    return planned


def run_sweep(planned: Sequence[Planned], bench: Bench) -> list[Swept]:
    """Run whatever of the points was not run before; what came of each, in their order."""
    points = [each.point for each in planned if each.point is not None]
    trials = iter(bench.run(points, "sweep"))
    return [Swept(each.settings, None if each.point is None else next(trials), each.reason) for each in planned]
