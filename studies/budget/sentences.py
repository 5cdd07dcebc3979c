"""A budget in words: a sentence for each quantity."""

from math import floor, isfinite, log10

from .budget import Budget, Contribution, Quantity

#: The fraction of the error from which on one source makes nearly all of it, and below which a source is left out.
_NEARLY_ALL, _WORTH_SAYING = 0.8, 0.01


def sentences(budget: Budget) -> list[str]:
    """`activation at apex: 107.2 ms ± 9.1, nearly all from the mesh; the communication step adds 0.3`."""
    return [sentence(quantity) for quantity in budget.quantities]


def sentence(quantity: Quantity) -> str:
    """The value, its error, the sources of the error, and which of their estimates are not trusted."""
    known = [each for each in quantity.contributions if isfinite(each.estimate)]
    ranked = sorted(known, key=lambda each: -abs(each.estimate))
    told = [each for each in ranked if abs(each.estimate) > _WORTH_SAYING * quantity.error and not each.negligible]
    text = f"{quantity.spoken}: {measured(quantity)}{_where_from(quantity, told)}"
    doubtful = [each.source for each in told if not each.trusted]
    if doubtful:
        text += f" (not trusted: {_listed(doubtful)})"
    unknown = [each.source for each in quantity.contributions if not isfinite(each.estimate)]
    if unknown:
        text += f" (unknown: {_listed(unknown)})"
    return text


def measured(quantity: Quantity) -> str:
    """Value and error in the quantity's unit of measure: `107.2 ms ± 9.1`."""
    error = quantity.error
    # An error at the level of round-off is reported as none.
    if error <= 1e-9 * abs(quantity.value):
        return f"{quantity.value:.6g} {quantity.unit}".rstrip() + " ± 0"
    digits = max(0, 1 - floor(log10(error)))
    unit = f" {quantity.unit}" if quantity.unit else ""
    return f"{quantity.value:.{digits}f}{unit} ± {error:.{digits}f}"


def _where_from(quantity: Quantity, told: list[Contribution]) -> str:
    if not told:
        return ""
    first, *rest = told
    if len(told) == 1:
        return f", all from the {first.source}"
    others = [f"the {each.source} {_size(each)}" for each in rest]
    if abs(first.estimate) >= _NEARLY_ALL * quantity.error:
        begin, what = f", nearly all from the {first.source}", others
        return f"{begin}; the {rest[0].source} adds {_listed([_size(rest[0]), *what[1:]])}"
    return f"; the {first.source} contributes {_listed([_size(first), *others])}"


def _size(contribution: Contribution) -> str:
    return f"{abs(contribution.estimate):.2g}"


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
