"""Makes the coupling scheme that the coupling section of a scenario describes."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict

from ..errors import InputError, did_you_mean
from ..participants.participant import Participant
from ..scenario import Coupling, Iterate, Scenario
from .acceleration import Acceleration, Aitken, Anderson, Relaxation
from .connections import Connection
from .convergence import Criterion
from .exchange import Inputs
from .iteration import Iterated, Limits
from .master import Master, stepping_order
from .schemes import SCHEMES, Scheme
from .step_control import AdaptiveStep, FixedStep, StepControl
from .timeline import Timeline

#: Relaxation where none is given (Aitken: of a step's first sweep).
_RELAXATION = 0.5

#: What is asked of a field that a loop's sweeps start from and that no criterion names (`convergence`).
_UNNAMED = "no criterion of its own: its residual, relative to its magnitude, has to meet the strictest given criterion"


def build_scheme(
    coupling: Coupling, participants: Mapping[str, Participant], connections: Sequence[Connection]
) -> tuple[Scheme, dict[str, str]]:
    """The scheme, and the fields ("unit.field") that have to converge in an iterated step, with their criteria.

    Raises
    ------
    InputError
        If a field to converge is exchanged in no loop, or a unit of a loop cannot roll back.
    """
    sweep = SCHEMES[coupling.scheme]()
    settings = coupling.iterate
    if settings is None:
        return sweep, {}
    limits = Limits(_criteria(settings, connections), settings.max_iterations, settings.on_limit == "error")
    scheme = Iterated(sweep, participants, connections, _acceleration(settings), limits)
    rings = [group.units for group in scheme.groups(list(participants)) if group.is_loop]
    looped = [unit for ring in rings for unit in ring]
    if not looped:
        raise InputError("coupling.iterate: no units form a loop, so there is nothing to iterate; remove it")
    for unit in looped:
        if not participants[unit].abilities.rolls_back:
            raise InputError(
                f"coupling.iterate: unit '{unit}' cannot roll back (canGetAndSetFMUstate is false); "
                "remove `iterate`, or that unit from the loop"
            )
    fields = {ring: scheme.fields(ring) for ring in rings}
    exchanged = [name for ring in rings for name in fields[ring]]
    for name in limits.criteria:
        if name not in exchanged:
            raise InputError(f"coupling.iterate.converge: {name} is exchanged in no loop; remove it")
    for ring in rings:
        if not any(name in limits.criteria for name in fields[ring]):
            raise InputError(
                f"coupling.iterate.converge: no field of the loop of {', '.join(ring)} has a criterion; "
                "name one that they exchange"
            )
    judged = {name: _in_words(criterion) for name, criterion in limits.criteria.items()}
    unnamed = [name for ring in rings for name, carried in fields[ring].items() if carried and name not in judged]
    return scheme, judged | dict.fromkeys(unnamed, _UNNAMED)


def build_master(
    scenario: Scenario, participants: Mapping[str, Participant], connections: Sequence[Connection], scheme: Scheme
) -> Master:
    """The master of a scenario; InputError where a unit lacks an ability that the scenario needs."""
    coupling, stop, every = scenario.coupling, scenario.run.stop_ms, scenario.output.every_ms
    control: StepControl
    if coupling.adaptive is None:
        timeline, control = Timeline.of_fixed_step(coupling.step_ms, stop, every), FixedStep()
    else:
        limits = coupling.adaptive
        timeline = Timeline.of_shortest_step(limits.min_ms, stop, every)
        control = AdaptiveStep(timeline, limits.tolerance, limits.min_ms, limits.max_ms, coupling.step_ms, participants)
        for unit in stepping_order(participants, coupling.order):
            abilities = participants[unit].abilities
            lacks = None if abilities.rolls_back else "cannot roll back (canGetAndSetFMUstate is false)"
            if not abilities.any_step_size:
                lacks = "takes equal steps only (canHandleVariableCommunicationStepSize is false)"
            if lacks is not None:
                raise InputError(f"coupling.adaptive: unit '{unit}' {lacks}; give `step_ms` instead")
    rates = {name: entry.every for name, entry in scenario.units.items()}
    rates |= dict.fromkeys(idle(participants, connections), timeline.stop + 1)
    _check_equal_steps(rates, participants, timeline)
    inputs = Inputs(coupling.extrapolation, coupling.interpolation == "linear", control.depth)
    return Master(participants, connections, scheme, timeline, coupling.order, inputs, control, rates)


def _check_equal_steps(rates: Mapping[str, int], participants: Mapping[str, Participant], timeline: Timeline) -> None:
    """InputError where a unit that takes equal steps only would be cut short by an output or by the end."""
    for unit, rate in rates.items():
        ticks = min(rate, timeline.every)
        if not participants[unit].abilities.any_step_size and (timeline.every % ticks or timeline.stop % ticks):
            raise InputError(
                f"units.{unit}.every: it takes equal steps only (canHandleVariableCommunicationStepSize is false), "
                f"but the unit steps at output times and at the end as well, and {rate} exchanges of "
                f"{timeline.tick_ms:g} ms do not divide these times; change `every`, `output.every_ms` or `run.stop_ms`"
            )


def idle(participants: Mapping[str, Participant], connections: Sequence[Connection]) -> list[str]:
    """Units that need to step at output times only: memoryless, and nothing that steps otherwise is fed by them."""
    found: list[str] = []
    while True:
        more = [
            name
            for name, participant in participants.items()
            if name not in found
            and participant.abilities.memoryless
            and all(link.target.unit in found for link in connections if link.source.unit == name)
        ]
        if not more:
            return found
        found += more


def _criteria(settings: Iterate, connections: Sequence[Connection]) -> dict[str, Criterion]:
    """The criteria by "unit.field"; a field may be named without its unit where one unit alone has it."""
    known = {str(link.source): link.source for link in connections}
    criteria = {}
    for key, limits in settings.converge.items():
        found = [name for name, end in known.items() if key in (name, end.name)]
        if len(found) != 1:
            problem = "names several fields" if found else "is not a connected output"
            raise InputError(f"coupling.iterate.converge: '{key}' {problem}{did_you_mean(key, known)}")
        criteria[found[0]] = Criterion(limits.absolute, limits.relative, limits.residual_relative)
    return criteria


def _in_words(criterion: Criterion) -> str:
    limits = {measure.replace("_", "-"): limit for measure, limit in asdict(criterion).items() if limit is not None}
    return " or ".join(f"{measure} {limit:g}" for measure, limit in limits.items())


def _acceleration(settings: Iterate) -> Acceleration:
    if settings.acceleration == "anderson":
        # Its first iterate is that of the plain iteration: where that converges, relaxing it would cost a sweep.
        return Anderson(settings.relaxation or 1.0)
    if settings.acceleration == "aitken":
        return Aitken(settings.relaxation or _RELAXATION)
    return Relaxation(1.0 if settings.acceleration == "none" else settings.relaxation or _RELAXATION)
