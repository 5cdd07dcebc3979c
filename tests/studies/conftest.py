"""Studies of one cell: points of a tenth of a second."""

from collections.abc import Callable
from dataclasses import dataclass
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


@pytest.fixture(autouse=True)
def _timed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Short runs are not repeated: few tests look at what runs cost."""
    monkeypatch.setattr("cardiac_cosim.studies.bench._REPEATS_S", 0.0)


@dataclass(frozen=True)
class Steps:
    """`study` of `STUDY`, charted into `output`; short runs were repeated, as they are for a person."""

    study: Path
    output: Path
    chart: Chart

    def again(self, text: str) -> Chart:
        """The chart of a study of this text in the place of the other one: points that both have are not run again."""
        path = self.study.with_name("again.yaml")
        path.write_text(text)
        with Bench(self.output) as bench:
            return chart_study(plan_study(path), bench)


@pytest.fixture(scope="session")
def steps(tmp_path_factory: pytest.TempPathFactory) -> Steps:
    """One for all tests that read what such a study leaves."""
    folder = tmp_path_factory.mktemp("steps")
    (folder / "small_cell.yaml").write_text(_SCENARIO)
    study = folder / "steps.yaml"
    study.write_text(STUDY)
    with Bench(folder / "out") as bench:
        return Steps(study, folder / "out", chart_study(plan_study(study), bench))


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
