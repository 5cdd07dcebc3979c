"""By how much runs differ, as rows of a table."""

from dataclasses import dataclass
from math import nan

from ...orchestrator.results.comparison import headlines, measures, spoken, unit_of
from .compared import Compared


@dataclass(frozen=True)
class Row:
    """A quantity of one run against the reference.

    A headline number has `reference` and `value`, and `difference` is the value less the reference. Of a measure over
    the whole run only the `difference` is given, and `time_ms`, the moment at which it is that large. `why` says why a
    number is missing or infinite.
    """

    quantity: str
    unit: str
    description: str
    run: str
    difference: float
    reference: float | None = None
    value: float | None = None
    time_ms: float | None = None
    why: str = ""


def headline_rows(compared: Compared) -> list[Row]:
    """The headline numbers that the reference or another run has, each run's beside the reference's."""
    theirs = headlines(compared.runs[compared.reference])
    ours = {name: headlines(run) for name, run in compared.others.items()}
    names = dict.fromkeys([*theirs, *(key for each in ours.values() for key in each)])
    rows = []
    for name in names:
        for run, own in ours.items():
            reference, value = theirs.get(name), own.get(name)
            known = reference is not None and value is not None
            missing = "" if known else f"only the run {compared.reference if value is None else run} has it"
            difference = nan if reference is None or value is None else value - reference
            rows.append(Row(name, unit_of(name), spoken(name), run, difference, reference, value, why=missing))
    return rows


def measure_rows(compared: Compared) -> list[Row]:
    """The largest differences over the whole run, of every curve and every field, with the time of each."""
    reference = compared.runs[compared.reference]
    rows = []
    for measure in measures(reference).values():
        for name, run in compared.others.items():
            found = measure.between(run, reference)
            rows.append(
                Row(
                    measure.name,
                    measure.unit,
                    measure.description,
                    name,
                    found.value,
                    time_ms=found.time_ms,
                    why=found.why,
                )
            )
    return rows


@dataclass(frozen=True)
class Differences:
    """All that differs: headline numbers, and the largest differences over the whole run."""

    headlines: list[Row]
    measured: list[Row]


def differences(compared: Compared) -> Differences:
    """Computed once for table and page: every frame of every field of all runs is read for it."""
    return Differences(headline_rows(compared), measure_rows(compared))
