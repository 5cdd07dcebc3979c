"""A variable's declaration in the words of FMI, the same ones in 2.0 (section 2.2.7) and 3.0 (section 2.4.7)."""

from ...units.variable import Causality, Variable
from ..layout import Run


def role(variable: Variable) -> dict[str, str]:
    """How it crosses the boundary, when it may change, and where its first value comes from."""
    causality = variable.causality
    if causality is Causality.PARAMETER:
        variability, initial = "fixed", "exact"
    elif causality is Causality.CALCULATED_PARAMETER:
        variability, initial = "fixed", "calculated"
    else:
        variability, initial = "discrete" if variable.fixed else "continuous", "calculated"
    found = {"causality": causality.value, "variability": variability}
    # Of an input both standards know it already, and FMI 2.0 forbids to say it.
    return found if causality is Causality.INPUT else found | {"initial": initial}


def is_unknown(run: Run) -> bool:
    """Whether the unit computes its initial value."""
    return run.variable.causality in (Causality.OUTPUT, Causality.CALCULATED_PARAMETER)


def measure(run: Run, fmi: int) -> dict[str, str]:
    """Unit of measure and bound. FMI's bounds are inclusive: an exclusive one stays with the unit, which checks it."""
    variable = run.variable
    found = {"unit": variable.unit} if run.type_in(fmi) in ("Real", "Float64") else {}
    return found if variable.at_least is None else found | {"min": number(variable.at_least)}


def start(variable: Variable) -> str:
    """The start value, of a field that of all its places."""
    return variable.start if isinstance(variable.start, str) else number(variable.start)


def number(value: float) -> str:
    """As many digits as it takes to read the same number back."""
    return repr(value).removesuffix(".0")
