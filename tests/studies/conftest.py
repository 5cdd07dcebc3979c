"""Studies of one cell: points of a tenth of a second."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.chart import Chart, chart_study
from cardiac_cosim.studies.plan import plan_study

_SCENARIO = """\
name: small_cell
scene: {geometry: cell}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {time_scale_reduction: 0}}
  active_stress: {unit: active_stress}
  mechanics: {unit: local_mechanics}
coupling: {step_ms: 1}
run: {stop_ms: 40, participants: native}
output: {every_ms: 20, probes_mm: {cell: [10, 0, 0]}}
"""

#: A study of `small_cell.yaml` beside it.
STUDY = """\
name: steps
scenario: small_cell.yaml
reference: {coupling.step_ms: 0.25}
measures: [stretch, active_stress_kPa]
lines:
  - name: held
    vary: {coupling.step_ms: [0.5, 1, 2, 4]}
  - name: linear
    set: {coupling.interpolation: linear, coupling.extrapolation: 1}
    vary: {coupling.step_ms: [1, 2, 4]}
"""


@pytest.fixture
def small_cell(tmp_path: Path) -> Path:
    """The file of a scenario of one cell."""
    path = tmp_path / "small_cell.yaml"
    path.write_text(_SCENARIO)
    return path


@pytest.fixture
def study(tmp_path: Path, small_cell: Path) -> Path:
    """The file of a study, next to its scenario."""
    path = tmp_path / "steps.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture
def charted(tmp_path: Path) -> Callable[..., Chart]:
    """Charts a study in a folder of the test; `options` are those of Bench."""

    def chart(path: Path, *assignments: str, output: str = "out", **options: Any) -> Chart:
        with Bench(tmp_path / output, **options) as bench:
            return chart_study(plan_study(path, assignments), bench)

    return chart
