"""A strand on which a budget takes seconds, and runs that give numbers of a known law instead of physics."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import Scenario

_STRAND = """\
name: short_strand
scene: {geometry: strand, mesh_size_mm: 4}
units:
  fibers: {unit: fiber_generator}
  electrophysiology:
    unit: electrophysiology
    parameters: {time_scale_reduction: 0, stimulus_x_min_mm: -1, stimulus_x_max_mm: 8}
  active_stress: {unit: active_stress}
  mechanics: {unit: local_mechanics}
coupling: {step_ms: 1}
run: {stop_ms: 30, participants: native}
output: {every_ms: 10, probes_mm: {near: [12, 0, 0]}}
"""


@pytest.fixture(scope="session")
def strand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a scenario of a tenth of a second."""
    path = tmp_path_factory.mktemp("strand") / "strand.yaml"
    path.write_text(_STRAND)
    return path


#: From a scenario to the activation at its probe, in ms; None where it is not activated.
Law = Callable[[Scenario], float | None]


@dataclass
class Runner:
    """A bench whose runs obey a law: it notes the settings of all that it ran."""

    law: Law
    seconds: Callable[[Scenario], float] = lambda scenario: 1.0
    failing: Callable[[Scenario], str] = lambda scenario: ""
    ran: list[dict[str, Any]] = field(default_factory=list)

    def run(self, points: Iterable[Any], title: str) -> list[Any]:
        return [self._trial(point) for point in points]

    def _trial(self, point: Any) -> Any:
        self.ran.append(dict(point.settings))
        reason = self.failing(point.scenario)
        summary = {"activation_time_ms": {"near": self.law(point.scenario)}}
        return SimpleNamespace(
            is_done=not reason,
            status="failed" if reason else "done",
            reason=reason,
            cpu_s=self.seconds(point.scenario),
            run=SimpleNamespace(summary=summary, columns={}),
        )


@pytest.fixture(scope="session")
def runner() -> type[Runner]:
    return Runner
