"""From a scenario to its error budget: one finer run for each source, and more where these do not tell the order."""

from collections.abc import Iterable, Mapping, Sequence
from math import nan

from ...orchestrator.errors import InputError
from ...orchestrator.results.stored_run import StoredRun
from ..bench import Bench
from ..plan import Variants
from ..point import told
from .budget import Budget, Contribution, Quantity
from .richardson import Estimate, richardson
from .runs import Runs
from .source import BASE, COARSER, FINER, FINEST, Settings, Source
from .sources import sources_of, unknown_sources

#: A run that is to take longer than this, in processor seconds, is not made to confirm an order.
_LONGEST_S = 600.0


def error_budget(variants: Variants, bench: Bench, known: StoredRun | None = None) -> Budget:
    """The error budget of the scenario itself; `known` are its results, where it was run.

    Raises
    ------
    InputError
        Where the scenario cannot be run, or records nothing.
    RunError
        Where its run fails.
    Interrupted
        When a signal asked for it; all runs that are finished by then are kept.
    """
    scenario = variants.scenario({})
    sources = sources_of(scenario)
    runs = Runs(variants, bench, known)
    values = runs.base().values
    if not values:
        raise InputError("the scenario records no number whose error could be estimated; see `output` in the scenario")
    runs.run(_settings(sources, (BASE, FINER, COARSER)), "finer in one source each")
    unclear = [source for source in sources if _is_open(source, values, runs)]
    finest = [source for source in unclear if _predicted_s(source, runs) <= _LONGEST_S]
    runs.run(_settings(finest, (FINEST,)), "finer once more")
    return Budget(
        scenario.name,
        sources,
        [
            Quantity(name, value, [_contribution(source, name, value, runs) for source in sources])
            for name, value in values.items()
        ],
        unknown_sources(scenario),
    )


def _settings(sources: Sequence[Source], levels: Sequence[int]) -> list[Settings]:
    return [
        settings
        for source in sources
        for level in levels
        if level in source.levels
        for settings in source.levels[level].runs
    ]


def _is_open(source: Source, quantities: Iterable[str], runs: Runs) -> bool:
    """Whether there is a quantity whose order is not clear, and which another run may make clear."""
    found = (_values(source, name, runs) for name in quantities)
    return any(
        not richardson(values, source.ratio, source.highest_order).is_settled
        for values, _ in found
        if BASE in values and FINER in values
    )


def _predicted_s(source: Source, runs: Runs) -> float:
    """Processor seconds of the runs at FINEST that were not made, if they grow as those before did."""
    before = runs[source.levels[BASE].settings].seconds
    pairs = zip(source.levels[FINER].runs, source.levels[FINEST].runs, strict=True)
    return sum(runs[one].seconds * max(1.0, runs[one].seconds / before) for one, next_ in pairs if next_ not in runs)


def _values(source: Source, quantity: str, runs: Runs) -> tuple[dict[int, float], dict[int, str]]:
    """The values of a quantity by level, as far as there are, and why there is none at other levels that were tried."""
    values, reasons = {}, {}
    for level, at in source.levels.items():
        if not all(settings in runs for settings in at.runs):
            continue
        missing = [reason for settings in at.runs if (reason := _missing(settings, quantity, runs))]
        if missing:
            reasons[level] = missing[0]
            continue
        values[level] = runs[at.settings].values[quantity]
        if at.beside is not None:
            values[level] += runs[{}].values[quantity] - runs[at.beside].values[quantity]
    return values, reasons


def _missing(settings: Settings, quantity: str, runs: Runs) -> str:
    tried = runs[settings]
    return tried.reason or ("" if quantity in tried.values else f"the run with {told(settings)} has no {quantity}")


def _contribution(source: Source, quantity: str, value: float, runs: Runs) -> Contribution:
    values, reasons = _values(source, quantity, runs)
    if BASE in values and FINER in values:
        estimate = richardson(values, source.ratio, source.highest_order)
        finest = source.levels[max(values)]
    else:
        reason = reasons.get(BASE) or reasons.get(FINER) or ""
        estimate, finest = Estimate(nan, None, False, reason), source.levels[FINER]
    return Contribution(
        source.name,
        quantity,
        value,
        estimate.error,
        estimate.order,
        estimate.trusted,
        estimate.reason if estimate.is_settled else "; ".join([estimate.reason, *_help(source, values, reasons, runs)]),
        str(finest),
        estimate.negligible,
    )


def _help(source: Source, values: Mapping[int, float], reasons: Mapping[int, str], runs: Runs) -> list[str]:
    """What else there is to say of an estimate that is not trusted, and what would help."""
    if BASE not in values or FINER not in values:
        return []
    if FINEST in reasons:
        return [reasons[FINEST]]
    if FINEST in values:
        return [source.remedy]
    minutes = _predicted_s(source, runs) / 60.0
    run = source.levels[FINEST]
    return [f"a run with {run} would help; it takes about {minutes:.0f} minutes and was not made", source.remedy]
