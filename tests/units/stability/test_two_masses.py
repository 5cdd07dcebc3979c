"""If these fail, a map draws the limit of the two-mass oscillator where it is not."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.stability.exchange_map import LinearUnit, Seen, exchange_map, spectral_radius
from cardiac_cosim.units.stability.theory import Coupled, Setting
from cardiac_cosim.units.stability.two_masses import TwoMasses, linear_masses
from oscillator import Oscillator
from scipy.optimize import brentq

_SCENARIO = Path(__file__).parents[3] / "scenarios" / "oscillator.yaml"
_MILD = Oscillator()
#: m = 1, k = 10/100/1000, c = 0.01 of the published comparison; its middle values are those of the coupling.
_STIFF = Oscillator((10.0, 1000.0, 100.0), (0.01, 0.01, 0.01))


def _masses(oscillator: Oscillator, split: str, mass: float = 1.0) -> dict[str, dict[str, float]]:
    (k1, k2, kc), (c1, c2, cc) = oscillator.stiffness, oscillator.damping
    coupling = {"k_c": kc, "c_c": cc}
    first = {"m": mass, "k": k1, "c": c1} | (coupling if split == "DD" else {})
    return {"first": first, "second": {"m": mass, "k": k2, "c": c2} | coupling}


def _coupled(oscillator: Oscillator, split: str, scheme: str, order: int, size_s: float, kind: str = "mass") -> Coupled:
    units = {name: Setting(kind, parameters) for name, parameters in _masses(oscillator, split).items()}
    return Coupled(units, scheme == "jacobi", 1e3 * size_s, order > 0, order)


def _first_unstable(radius: Callable[[float], float], lowest: float) -> float | None:
    """The first step in s of an unstable range up to 3.2 s."""
    sizes = np.geomspace(lowest, 3.2, 200)
    for below, above in pairwise(sizes):
        if radius(above) > 1.0 + 1e-12:
            return float(brentq(lambda size: radius(size) - 1.0, below, above, rtol=1e-8))
    return None


@pytest.mark.parametrize("oscillator", [_MILD, _STIFF], ids=["mild", "stiff"])
@pytest.mark.parametrize("split", ["FD", "DD"])
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
@pytest.mark.parametrize("order", [0, 1])
def test_the_matrix_is_that_of_another_code(oscillator: Oscillator, split: str, scheme: str, order: int) -> None:
    for size in (1e-3, 0.03, 0.3, 1.7):
        expected = np.abs(np.linalg.eigvals(oscillator.amplification(split, scheme, order, size))).max()
        found = TwoMasses().amplification(_coupled(oscillator, split, scheme, order, size))
        assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(
    ("oscillator", "split", "scheme", "order", "limit"),
    [
        (_STIFF, "FD", "gauss-seidel", 0, 3.64e-4),
        (_STIFF, "FD", "gauss-seidel", 1, 1.81e-2),
        (_STIFF, "DD", "jacobi", 0, 2.22e-3),
        (_STIFF, "DD", "gauss-seidel", 0, None),
        (_STIFF, "DD", "jacobi", 1, 1.43e-2),
        (_STIFF, "DD", "gauss-seidel", 1, 1.89e-2),
        (_MILD, "FD", "gauss-seidel", 0, 0.0777),
        (_MILD, "FD", "gauss-seidel", 1, 0.318),
        (_MILD, "DD", "jacobi", 0, 0.319),
        (_MILD, "DD", "gauss-seidel", 0, None),
        (_MILD, "DD", "jacobi", 1, 0.267),
        (_MILD, "DD", "gauss-seidel", 1, None),
    ],
)
def test_limits_are_the_published_ones(
    oscillator: Oscillator, split: str, scheme: str, order: int, limit: float | None
) -> None:
    # Computed with a code of another author, and given in three digits.
    found = _first_unstable(
        lambda size: TwoMasses().amplification(_coupled(oscillator, split, scheme, order, size)), 1e-4
    )
    assert found == (None if limit is None else pytest.approx(limit, rel=5e-3))


@pytest.mark.parametrize(
    ("oscillator", "order", "limit"), [(_STIFF, 0, 4.55e-4), (_STIFF, 1, 1.40e-2), (_MILD, 0, 0.225), (_MILD, 1, 0.228)]
)
def test_a_master_that_asks_for_the_force_anew_has_the_published_limits_of_jacobi(
    oscillator: Oscillator, order: int, limit: float
) -> None:
    # Ours takes the force that was computed in the step. There, the first mass is pulled by what follows from both
    # places at the exchange: written as a unit that is fed by its own past as well.
    def radius(size: float) -> float:
        coupled = _coupled(oscillator, "FD", "jacobi", order, size)
        units, (_, _, stiffness), (_, _, damping) = linear_masses(coupled), oscillator.stiffness, oscillator.damping
        pulled = units["first"].step

        def step(motion: np.ndarray, seen: Seen) -> tuple[np.ndarray, np.ndarray]:
            weights = np.array([[stiffness, damping, -stiffness, -damping]])
            return pulled(motion, Seen(*(weights @ values for values in (seen.begin, seen.end, seen.bend))))

        feeding = (("second", 0), ("second", 1), ("first", 0), ("first", 1))
        return spectral_radius(exchange_map({**units, "first": LinearUnit(2, 3, feeding, step)}, coupled))

    assert _first_unstable(radius, 1e-4) == pytest.approx(limit, rel=5e-3)


@pytest.mark.parametrize(
    ("split", "order", "backwards"),
    [
        ("FD", 0, False),
        ("FD", 1, False),
        ("FD", 2, False),
        ("FD", 0, True),
        ("FD", 1, True),
        ("DD", 0, False),
        ("DD", 1, True),
    ],
)
@pytest.mark.parametrize("scheme", ["jacobi", "gauss-seidel"])
def test_a_run_fails_where_it_is_predicted_to(
    split: str, scheme: str, order: int, backwards: bool, rows: Any, growth: Any
) -> None:
    # Other numbers than those of any table, and other masses.
    oscillator = Oscillator((14.0, 33.0, 21.0), (0.4, 0.2, 0.9))
    parameters = _masses(oscillator, split, 1.3)
    order_of_steps = ["second", "first"] if backwards else ["first", "second"]
    units = {name: Setting("mass", parameters[name]) for name in order_of_steps}

    def amplification(size: float) -> float:
        return TwoMasses().amplification(Coupled(units, scheme == "jacobi", 1e3 * size, order > 0, order))

    limit = _first_unstable(amplification, 1e-3)
    sizes = (0.03, 0.3, 1.0) if limit is None else (0.99 * limit, 1.01 * limit)
    force = "[first.x -> second.x_in, first.v -> second.v_in, second.F -> first.F_in]"
    places = "[first.x -> second.x_in, first.v -> second.v_in, second.x -> first.x_in, second.v -> first.v_in]"
    for size in sizes:
        sets = {
            "units": "{"
            + ", ".join(
                f"{name}: {{unit: mass, parameters: {{x_start: 1, {', '.join(f'{k}: {v}' for k, v in own.items())}}}}}"
                for name, own in parameters.items()
            )
            + "}",
            "connections": force if split == "FD" else places,
            "coupling.scheme": scheme,
            "coupling.order": f"[{', '.join(order_of_steps)}]",
            "coupling.interpolation": "linear" if order else "hold",
            "coupling.extrapolation": order,
        }
        series = rows(_SCENARIO, size * 1e3, 100, sets)
        states = np.stack([series[name] for name in ("firstx", "firstv", "secondx", "secondv")], axis=1)
        measured, predicted = growth(states), amplification(size)
        assert (measured > 1.0) == (predicted > 1.0)
        assert measured == pytest.approx(predicted, abs=1e-5)


@pytest.mark.parametrize("order", [0, 1, 2])
def test_foreign_masses_have_the_same_theory(order: int, bodies: dict[str, Path], rows: Any, growth: Any) -> None:
    # Built in C by another hand; they follow parabolas inside a step where the extrapolation gives them some.
    parameters = _masses(_MILD, "FD")
    del parameters["first"]["m"]

    def amplification(size: float) -> float:
        units = {name: Setting("fmu", own) for name, own in parameters.items()}
        return TwoMasses().amplification(Coupled(units, True, 1e3 * size, order > 0, order))

    limit = _first_unstable(amplification, 1e-3)
    assert limit is not None
    for size in (0.98 * limit, 1.02 * limit):
        units = ", ".join(
            f"{name}: {{fmu: {bodies['whole']}, start: {{x: 1}}, parameters: "
            f"{{{', '.join(f'{k}: {v}' for k, v in own.items())}}}}}"
            for name, own in parameters.items()
        )
        sets = {
            "units": f"{{{units}}}",
            "coupling.scheme": "jacobi",
            "coupling.interpolation": "linear" if order else "hold",
            "coupling.extrapolation": order,
            "run.participants": "fmu",
            "scene": "null",
            "output.variables": "['first.*', 'second.*']",
        }
        series = rows(_SCENARIO, size * 1e3, 100, sets)
        states = np.stack([series[name] for name in ("firstx", "firstv", "secondx", "secondv")], axis=1)
        measured, predicted = growth(states), amplification(size)
        assert (measured > 1.0) == (predicted > 1.0)
        assert measured == pytest.approx(predicted, abs=1e-5)


def test_what_the_theory_does_not_fit_is_refused() -> None:
    free, held = Setting("mass", {"k": 1.0}), Setting("mass", {"k": 1.0, "k_c": 1.0})
    with pytest.raises(InvalidInput, match=r"applies to two masses, .* not to 1"):
        TwoMasses().amplification(Coupled({"a": held}, False, 1.0))
    with pytest.raises(InvalidInput, match="give k_c or c_c"):
        TwoMasses().amplification(Coupled({"a": free, "b": free}, False, 1.0))
    with pytest.raises(InvalidInput, match="orders 0, 1 and 2, not 3"):
        TwoMasses().amplification(Coupled({"a": held, "b": held}, False, 1.0, True, 3))
