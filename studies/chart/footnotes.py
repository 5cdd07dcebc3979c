"""Why points have no result, or an error that is none, numbered: the pictures have no room for it at the points."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan

from ...orchestrator.quoting import shortened
from ..point import told, value_text
from .chart import Chart, Row

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
    reasons: dict[tuple[str, str], dict[str, list[Row]]] = {}
    for line in chart.lines:
        for row in line.rows:
            if row.is_done and all(isfinite(row.errors.get(measure.name, nan)) for measure in chart.measures):
                continue
            kind = row.status
            if row.is_done:
                kind = "infinite error" if inf in row.errors.values() else "not comparable"
            reasons.setdefault((kind, row.reason), {}).setdefault(line.name, []).append(row)
            numbers[id(row)] = list(reasons).index((kind, row.reason)) + 1
    texts = []
    for (kind, reason), points in reasons.items():
        names = "; ".join(f"{name} ({_settings(rows)})" for name, rows in points.items())
        said = f"{kind}: {shortened(reason, _LONGEST)}" if reason else kind
        texts.append(f"{shortened(names, _LONGEST)}: {said}")
    return Footnotes(texts, numbers)


def _settings(rows: Sequence[Row]) -> str:
    """All values of the one key that varies, or all settings of each point."""
    keys = {tuple(row.settings) for row in rows}
    if len(keys) == 1 and len(next(iter(keys))) == 1:
        ((key,),) = keys
        return f"{key}={', '.join(value_text(row.settings[key]) for row in rows)}"
    return "; ".join(told(row.settings) for row in rows)
