"""From the coupling section of a scenario to the scheme that it asks for."""

from collections.abc import Mapping, Sequence

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


def build_scheme(
    coupling: Coupling, participants: Mapping[str, Participant], connections: Sequence[Connection]
) -> tuple[Scheme, list[str]]:
    """The scheme, and the fields ("unit.field") that it brings to convergence.

    Raises
    ------
    InputError
        If a field to converge is exchanged in no loop, or a unit of a loop cannot roll back.
    """
    sweep = SCHEMES[coupling.scheme]()
    settings = coupling.iterate
    if settings is None:
        return sweep, []
    limits = Limits(_criteria(settings, connections), settings.max_iterations, settings.on_limit == "error")
    scheme = Iterated(sweep, participants, connections, _acceleration(settings), limits)
    rings = [group for group, loops in scheme.groups(list(participants)) if loops]
    looped = [unit for ring in rings for unit in ring]
    if not looped:
        raise InputError("coupling.iterate: no units form a loop, so there is nothing to iterate; remove it")
    for unit in looped:
        if not participants[unit].abilities.rolls_back:
            raise InputError(
                f"coupling.iterate: unit '{unit}' cannot roll back (canGetAndSetFMUstate is false); "
                "remove `iterate`, or that unit from the loop"
            )
    for name in limits.criteria:
        if name.split(".")[0] not in looped:
            raise InputError(f"coupling.iterate.converge: {name} is exchanged in no loop; remove it")
    for ring in rings:
        if not any(name.split(".")[0] in ring for name in limits.criteria):
            raise InputError(
                f"coupling.iterate.converge: no field of the loop of {', '.join(ring)} has a criterion; "
                "name one that they exchange"
            )
    return scheme, list(limits.criteria)


def build_master(
    scenario: Scenario, participants: Mapping[str, Participant], connections: Sequence[Connection], scheme: Scheme
) -> Master:
    """The master of a scenario; InputError where a unit cannot do what the scenario asks for."""
    coupling, stop, every = scenario.coupling, scenario.run.stop_ms, scenario.output.every_ms
    control: StepControl
    if coupling.adaptive is None:
        timeline, control = Timeline.of_fixed_step(coupling.step_ms, stop, every), FixedStep()
    else:
        limits = coupling.adaptive
        timeline = Timeline.of_shortest_step(limits.min_ms, stop, every)
        control = AdaptiveStep(timeline, limits.tolerance, limits.min_ms, limits.max_ms, coupling.step_ms)
        for unit in stepping_order(participants, coupling.order):
            abilities = participants[unit].abilities
            lacks = None if abilities.rolls_back else "cannot roll back (canGetAndSetFMUstate is false)"
            if not abilities.any_step_size:
                lacks = "takes equal steps only (canHandleVariableCommunicationStepSize is false)"
            if lacks is not None:
                raise InputError(f"coupling.adaptive: unit '{unit}' {lacks}; give `step_ms` instead")
    rates = {name: entry.every for name, entry in scenario.units.items()}
    rates |= dict.fromkeys(idle(participants, connections), timeline.stop + 1)
    inputs = Inputs(coupling.extrapolation, coupling.interpolation == "linear", control.depth)
    return Master(participants, connections, scheme, timeline, coupling.order, inputs, control, rates)


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
            problem = "names several fields" if found else "is no connected output"
            raise InputError(f"coupling.iterate.converge: '{key}' {problem}{did_you_mean(key, known)}")
        criteria[found[0]] = Criterion(limits.absolute, limits.relative, limits.residual_relative)
    return criteria


def _acceleration(settings: Iterate) -> Acceleration:
    if settings.acceleration == "anderson":
        # Its first iterate is that of the plain iteration: where that converges, relaxing it would cost a sweep.
        return Anderson(settings.relaxation or 1.0)
    if settings.acceleration == "aitken":
        return Aitken(settings.relaxation or _RELAXATION)
    return Relaxation(1.0 if settings.acceleration == "none" else settings.relaxation or _RELAXATION)
