"""Maps of the two-mass oscillator, whose limit is known, and of one cell."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.stability import StabilityMap, map_study, plan_map
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.stability import registry
from cardiac_cosim.units.stability.theory import Theory
from oscillator import Oscillator

_SCENARIO = """\
name: masses
units:
  first: {fmu: BODY, parameters: {k: 10, c: 0.2}, start: {x: 1}}
  second: {fmu: BODY, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5}, start: {x: 0.5}}
connections: [first.x -> second.x_in, first.v -> second.v_in, second.F -> first.F_in]
coupling: {step_ms: 10}
run: {stop_ms: 200}
output: {every_ms: 200}
"""

#: Of `masses.yaml` beside it: explicit Gauss–Seidel with held inputs, 200 steps each.
STUDY = """\
name: limit
scenario: masses.yaml
steps: 200
growth: modes
theory: masses
bisect: 4
lines:
  - name: held
    vary:
      units.second.parameters.k_c: [10, 20]
      coupling.step_ms: [20, 50, 110, 250]
"""


class Masses(Theory):
    """The tests' own theory of the oscillator."""

    name: ClassVar[str] = "masses"
    formula: ClassVar[str] = "spectral radius < 1"

    def __init__(self) -> None:
        self.asked: list[Any] = []

    def amplification(self, coupled: Any) -> float:
        self.asked.append(coupled)
        if list(coupled.units) != ["first", "second"]:
            raise InvalidInput("it is of two masses, first and second")
        first, second = (coupled.units[name].parameters for name in ("first", "second"))
        oscillator = Oscillator((first["k"], second["k"], second["k_c"]), (first["c"], second["c"], second["c_c"]))
        scheme = "jacobi" if coupled.jacobi else "gauss-seidel"
        matrix = oscillator.amplification("FD", scheme, coupled.extrapolation, coupled.step_ms / 1000.0)
        return float(np.abs(np.linalg.eigvals(matrix)).max())


@pytest.fixture
def theory(monkeypatch: pytest.MonkeyPatch) -> Masses:
    """The theory of the tests, among those that studies may name."""
    theory = Masses()
    monkeypatch.setitem(registry.THEORIES, "masses", theory)
    return theory


@pytest.fixture
def limit_study(tmp_path: Path, bodies: dict[str, Path], theory: Masses) -> Path:
    """The file of a study of the oscillator's limit, next to its scenario."""
    (tmp_path / "masses.yaml").write_text(_SCENARIO.replace("BODY", str(bodies["whole"])))
    path = tmp_path / "limit.yaml"
    path.write_text(STUDY)
    return path


@pytest.fixture
def mapped(tmp_path: Path) -> Callable[..., StabilityMap]:
    """Maps a study in a folder of the test; `options` are those of Bench."""

    def of(path: Path, *assignments: str, output: str = "out", **options: Any) -> StabilityMap:
        with Bench(tmp_path / output, **options) as bench:
            return map_study(plan_map(path, assignments), bench)

    return of
