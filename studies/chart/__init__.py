"""Speed against accuracy: what every point of a study costs, and by how much it differs from a reference."""

from .chart import Chart, ChartLine, Row
from .chart_files import write_chart
from .charted import chart_study

__all__ = ["Chart", "ChartLine", "Row", "chart_study", "write_chart"]
