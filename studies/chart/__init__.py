"""Speed against accuracy: what every point of a study costs, and by how much it differs from a reference."""

from .charted import chart_study
from .model import Chart, ChartLine, Row
from .written import write_chart

__all__ = ["Chart", "ChartLine", "Row", "chart_study", "write_chart"]
