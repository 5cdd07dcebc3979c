"""If these fail, a map says that the active stress bears steps that it does not, or the other way round."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.active_stress import Tension
from cardiac_cosim.units.stability.active_stress_step import ActiveStressStep
from cardiac_cosim.units.stability.theory import Coupled


def _amplification(setting: Any, step_ms: float, **parameters: Any) -> float:
    return ActiveStressStep().amplification(
        Coupled({"tension": setting("active_stress", **parameters)}, False, step_ms)
    )


@pytest.mark.parametrize("fast", [1.0, 2.5])
@pytest.mark.parametrize("side", [0.99, 1.01])
def test_forward_euler_is_stable_up_to_twice_the_delays_time(fast: float, side: float, setting: Any) -> None:
    step_ms = side * 2.0 / fast
    predicted = _amplification(setting, step_ms, fast_rate_per_ms=fast, time_integration="forward_euler")
    # The tension of depolarised tissue by the unit's own rate, a step after the other.
    law, potential = Tension(fast_rate_per_ms=fast), np.array([20.0])
    tensions = [0.0]
    for _ in range(50):
        rate, target = float(law.rate(potential)[0]), float(law.target(potential)[0])
        tensions.append(tensions[-1] + step_ms * rate * (target - tensions[-1]))
    differences = np.abs(np.diff(tensions))
    assert differences[-1] / differences[-2] == pytest.approx(predicted, rel=1e-6)
    assert (predicted > 1.0) == (side > 1.0)


@pytest.mark.parametrize("step_ms", [0.01, 1.0, 100.0, 1e5])
def test_the_exact_step_is_stable_whatever_its_length(step_ms: float, setting: Any) -> None:
    assert _amplification(setting, step_ms) == pytest.approx(np.exp(-0.1 * step_ms))
    assert _amplification(setting, step_ms) < 1.0


def test_the_seeds_delay_function_is_unstable_at_any_step(setting: Any) -> None:
    # As printed its rate is -0.8/ms in depolarised tissue.
    for step_ms in (0.01, 1.0, 100.0):
        assert _amplification(setting, step_ms, delay_function="as_printed") == pytest.approx(np.exp(0.8 * step_ms))
    assert _amplification(setting, 1e5, delay_function="as_printed") == np.inf
