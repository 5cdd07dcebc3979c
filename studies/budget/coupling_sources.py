"""The errors of the coupling: those of the communication step, and of iterations that end at a tolerance."""

from collections.abc import Sequence

from ...orchestrator.scenario import Scenario
from .internal_steps import InternalStep, internal_steps
from .source import LEVELS, TOLERANCE_ORDER, TOLERANCE_RATIO, Level, Source

_ITERATE = "coupling.iterate"


def communication(scenario: Scenario) -> Source:
    """The communication step; with adaptive steps, their tolerance and limits."""
    adaptive = scenario.coupling.adaptive
    step_ms = scenario.coupling.step_ms
    if adaptive is not None:
        levels = {
            level: Level(
                {
                    "coupling.adaptive.tolerance": adaptive.tolerance * 4.0**-level,
                    "coupling.adaptive.min_ms": adaptive.min_ms * 2.0**-level,
                    "coupling.adaptive.max_ms": adaptive.max_ms * 2.0**-level,
                    "coupling.step_ms": step_ms * 2.0**-level,
                }
                if level
                else {}
            )
            for level in LEVELS
        }
        return Source(
            "communication step",
            "adaptive steps: a quarter of `tolerance`, half of `min_ms`, `max_ms` and `step_ms`",
            "the steps' length",
            levels,
            "lower `coupling.adaptive.tolerance`, or take fixed steps, whose errors are more regular",
        )
    steps = internal_steps(scenario)
    levels = {
        level: Level(
            ({"coupling.step_ms": step_ms * 2.0**-level} if level else {}) | _same_internal_steps(steps, level)
        )
        for level in LEVELS
    }
    return Source(
        "communication step",
        "half of `coupling.step_ms`, while units keep their internal steps",
        "the step's length",
        levels,
        f"shorten `coupling.step_ms` (now {step_ms:g})",
    )


def iteration(scenario: Scenario) -> Source | None:
    """The limits at which iterations end; None where nothing is iterated."""
    iterate = scenario.coupling.iterate
    if iterate is None:
        return None
    levels = {
        level: Level(
            {
                f"{_ITERATE}.converge": iterate.limits_times(TOLERANCE_RATIO**-level),
                # A run that had enough iterations is to have enough.
                f"{_ITERATE}.max_iterations": iterate.max_iterations * 2 ** max(level, 0),
            }
            if level
            else {}
        )
        for level in LEVELS
    }
    return Source(
        "iteration tolerance",
        "a quarter of each limit in `coupling.iterate.converge`, and twice `max_iterations`",
        "the tolerance",
        levels,
        "lower the limits in `coupling.iterate.converge`",
        TOLERANCE_RATIO,
        TOLERANCE_ORDER,
    )


def _same_internal_steps(steps: Sequence[InternalStep], level: int) -> dict[str, float]:
    """What keeps internal steps the same at every level, at one of them: as long as the shortest exchange allows."""
    kept = {step: step.at_all_levels_ms(LEVELS) for step in steps}
    return {step.key: length for step, length in kept.items() if not step.is_taken(length, level)}
