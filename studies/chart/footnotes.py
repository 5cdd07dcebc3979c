"""Why points have no result, or an error that is none, numbered: the pictures have no room for it at the points."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite, nan

from ...orchestrator.quoting import shortened
from ..point import told
from .model import Chart, Row

#: Characters of a reason and of the names of its points that are repeated.
_LONGEST = 300


@dataclass(frozen=True)
class Footnotes:
    """`texts` in the order of their numbers, which begin with 1; `numbers` are those of points, by the id of a row."""

    texts: list[str]
    numbers: Mapping[int, int]

    def number(self, row: Row) -> int | None:
        """Of a point; None for one without a footnote."""
        return self.numbers.get(id(row))


def footnotes(chart: Chart) -> Footnotes:
    """One for each reason, with all points that it is true of."""
    numbers: dict[int, int] = {}
    reasons: dict[tuple[str, str], dict[str, list[str]]] = {}
    for line in chart.lines:
        for row in line.rows:
            if row.is_done and all(isfinite(row.errors.get(measure.name, nan)) for measure in chart.measures):
                continue
            kind = row.status if not row.is_done else "an error is not a number"
            reasons.setdefault((kind, row.reason), {}).setdefault(line.name, []).append(told(row.settings))
            numbers[id(row)] = list(reasons).index((kind, row.reason)) + 1
    texts = []
    for (kind, reason), points in reasons.items():
        names = "; ".join(f"{name} ({'; '.join(settings)})" for name, settings in points.items())
        said = f"{kind}: {shortened(reason, _LONGEST)}" if reason else kind
        texts.append(f"{shortened(names, _LONGEST)}: {said}")
    return Footnotes(texts, numbers)
