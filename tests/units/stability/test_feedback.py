"""If these fail, a map draws the limit of a loop with a gain, a delay or a rate where it is not."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.stability.feedback import Feedback
from cardiac_cosim.units.stability.theory import Coupled

_SCENARIO = Path(__file__).parents[3] / "scenarios" / "feedback.yaml"
_SCHEMES = ["gauss-seidel", "jacobi"]


@pytest.fixture
def run(rows: Any, growth: Any, setting: Any) -> Any:
    """What a loop grows by per exchange in a run, and what it is predicted to."""

    def both(step_ms: float, scheme: str, forth: dict[str, float], back: dict[str, float], **behaviour: Any) -> Any:
        units = {"forth": setting("response", **forth), "back": setting("response", **back)}
        linear, extrapolation = behaviour.get("linear", False), behaviour.get("extrapolation", 0)
        predicted = Feedback().amplification(Coupled(units, scheme == "jacobi", step_ms, linear, extrapolation))
        sets = {
            "coupling.scheme": scheme,
            "coupling.interpolation": "linear" if linear else "hold",
            "coupling.extrapolation": extrapolation,
        }
        for name, parameters in (("forth", forth), ("back", back)):
            sets |= {f"units.{name}.parameters.{key}": value for key, value in parameters.items()}
        series = rows(_SCENARIO, step_ms, 60, sets)
        return growth(np.stack([series["forthy"], series["backy"]], axis=1)), predicted

    return both


@pytest.mark.parametrize("scheme", _SCHEMES)
@pytest.mark.parametrize("step_ms", [0.01, 1.0, 20.0])
@pytest.mark.parametrize("gain", [-0.99, -1.01, 0.99, 1.01, -3.0])
def test_an_instantaneous_loop_is_stable_below_a_gain_of_one_whatever_the_step(
    scheme: str, step_ms: float, gain: float, run: Any
) -> None:
    measured, predicted = run(step_ms, scheme, {"gain": 2.0}, {"gain": gain / 2.0})
    assert predicted == pytest.approx(abs(gain) ** (0.5 if scheme == "jacobi" else 1.0), rel=1e-12)
    assert measured == pytest.approx(predicted, rel=1e-6)
    assert (measured > 1.0) == (abs(gain) > 1.0)


@pytest.mark.parametrize("gain", [-3.0, -1.6])
@pytest.mark.parametrize("side", [0.99, 1.01])
def test_a_delay_makes_short_steps_stable(gain: float, side: float, run: Any) -> None:
    # e^(-eps H) + (1 - e^(-eps H)) g: below -1 where H is beyond -ln(1 - 2/(1 - g))/eps.
    rate = 0.4
    step_ms = -side * np.log(1.0 - 2.0 / (1.0 - gain)) / rate
    decayed = np.exp(-rate * step_ms)
    measured, predicted = run(step_ms, "gauss-seidel", {"gain": 1.0}, {"gain": gain, "delay_rate_per_ms": rate})
    assert predicted == pytest.approx(abs(decayed + (1.0 - decayed) * gain), rel=1e-12)
    assert measured == pytest.approx(predicted, rel=1e-6)
    assert (measured > 1.0) == (side > 1.0)


@pytest.mark.parametrize("side", [0.99, 1.01])
def test_a_dependence_on_the_rate_makes_long_steps_stable(side: float, run: Any) -> None:
    # z^2 + c z - c = 0 with c = a eta/H.
    eta, a = 3.0, 0.7
    step_ms = side * 2.0 * a * eta
    c = a * eta / step_ms
    measured, predicted = run(step_ms, "gauss-seidel", {"gain": -a}, {"gain": 0.0, "rate_gain_ms": eta})
    assert predicted == pytest.approx(np.abs(np.roots([1.0, c, -c])).max(), rel=1e-12)
    assert measured == pytest.approx(predicted, rel=1e-6)
    assert (measured > 1.0) == (side < 1.0)


@pytest.mark.parametrize("scheme", _SCHEMES)
@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("extrapolation", [0, 1, 2])
def test_any_of_these_together_are_as_predicted(scheme: str, linear: bool, extrapolation: int, run: Any) -> None:
    forth = {"gain": 0.8, "delay_rate_per_ms": 0.3}
    back = {"gain": -1.4, "rate_gain_ms": 0.9}
    for step_ms in (0.5, 4.0):
        measured, predicted = run(step_ms, scheme, forth, back, linear=linear, extrapolation=extrapolation)
        assert measured == pytest.approx(predicted, rel=1e-6)


def test_extrapolating_an_instantaneous_loop_makes_it_worse(setting: Any) -> None:
    # z^2 = g (2 z - 1): at g = -1/3 the larger root is -1.
    for gain, stable in ((-0.99 / 3.0, True), (-1.01 / 3.0, False)):
        units = {"a": setting("response"), "b": setting("response", gain=gain)}
        assert (Feedback().amplification(Coupled(units, False, 1.0, True, 1)) < 1.0) == stable


def test_a_ring_of_three_delays_the_error_by_three_exchanges_under_jacobi(setting: Any) -> None:
    units = {name: setting("response", gain=gain) for name, gain in (("a", 2.0), ("b", -3.0), ("c", 0.5))}
    assert Feedback().amplification(Coupled(units, True, 1.0)) == pytest.approx(3.0 ** (1.0 / 3.0), rel=1e-12)
    assert Feedback().amplification(Coupled(units, False, 1.0)) == pytest.approx(3.0, rel=1e-12)


def test_a_scenario_without_a_ring_is_refused(setting: Any) -> None:
    with pytest.raises(InvalidInput, match="in a ring, not to 1"):
        Feedback().amplification(Coupled({"a": setting("response"), "b": setting("mass")}, False, 1.0))
