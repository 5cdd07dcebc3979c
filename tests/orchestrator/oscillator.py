"""The two-mass oscillator, the benchmark of co-simulation (Busch 2012; Schweizer et al. 2015), split in two ways.

    m₁ x₁″ = −k₁ x₁ − c₁ x₁′ + F,   m₂ x₂″ = −k₂ x₂ − c₂ x₂′ − F,   F = k_c (x₂ − x₁) + c_c (x₂′ − x₁′)

Force–displacement (FD): mass 1 gets F, mass 2 gets x₁ and x₁′ and computes F. Displacement–displacement (DD): each gets
the other's displacement and velocity. Each is integrated exactly for inputs that are constant or linear over a step.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import expm


@dataclass(frozen=True)
class Body:
    """m x″ + c x′ + k x = k_c (x_in − x) + c_c (x_in′ − x′) + F_in."""

    mass: float
    stiffness: float
    damping: float
    coupling_stiffness: float = 0.0
    coupling_damping: float = 0.0

    def step(self, state: np.ndarray, begin: float, end: float, size: float) -> np.ndarray:
        """(x, x′) after `size`, the input force running linearly from `begin` to `end`; exact."""
        return (self._propagator(size) @ np.array([*state, begin, (end - begin) / size]))[:2]

    @cache  # noqa: B019
    def _propagator(self, size: float) -> np.ndarray:
        matrix = np.zeros((4, 4))
        matrix[0, 1] = 1.0
        matrix[1, 0] = -(self.stiffness + self.coupling_stiffness) / self.mass
        matrix[1, 1] = -(self.damping + self.coupling_damping) / self.mass
        # The last two are the force and its slope.
        matrix[1, 2] = 1.0 / self.mass
        matrix[2, 3] = 1.0
        return expm(size * matrix)

    def load(self, other: np.ndarray, force: float = 0.0) -> float:
        """The force of the inputs."""
        return self.coupling_stiffness * other[0] + self.coupling_damping * other[1] + force


@dataclass(frozen=True)
class Oscillator:
    """Two unit masses (k₁, k₂, k_c and c₁, c₂, c_c), started from `start` = (x₁, x₁′, x₂, x₂′)."""

    stiffness: tuple[float, float, float] = (10.0, 20.0, 10.0)
    damping: tuple[float, float, float] = (0.2, 0.3, 0.5)
    start: tuple[float, float, float, float] = (1.0, 0.0, 0.5, 0.0)

    def exact(self, time: float) -> np.ndarray:
        """(x₁, x₁′, x₂, x₂′) at `time`, without co-simulation."""
        (k1, k2, kc), (c1, c2, cc) = self.stiffness, self.damping
        matrix = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-k1 - kc, -c1 - cc, kc, cc],
                [0.0, 0.0, 0.0, 1.0],
                [kc, cc, -k2 - kc, -c2 - cc],
            ]
        )
        return expm(time * matrix) @ self.start

    def bodies(self, split: str) -> tuple[Body, Body]:
        """The two sub-systems; under FD the first has the force as its input."""
        (k1, k2, kc), (c1, c2, cc) = self.stiffness, self.damping
        return (
            Body(1.0, k1, c1) if split == "FD" else Body(1.0, k1, c1, kc, cc),
            Body(1.0, k2, c2, kc, cc),
        )

    def units(self, fake: Any, port: Any, split: str) -> dict[str, Any]:
        """The sub-systems as participants that ramp their inputs, or hold them where the master only sets them."""
        names = {"first": ("F",) if split == "FD" else ("x2", "v2"), "second": ("x1", "v1")}
        units = {}
        for number, (unit, body) in enumerate(zip(names, self.bodies(split), strict=True), start=1):
            own = (f"x{number}", f"v{number}")
            outputs = [*own, *(["F"] if split == "FD" and unit == "second" else [])]
            begins = dict(zip(own, self.start[2 * number - 2 : 2 * number], strict=True))
            if "F" in outputs:
                begins["F"] = self._force(np.array(self.start[2:]), np.array(self.start[:2]))
            units[unit] = fake(
                unit,
                [port(name) for name in names[unit]],
                [port(name) for name in outputs],
                law=self._law(body, names[unit], outputs),
                begins=begins,
                ramps=True,
            )
        return units

    def _force(self, second: np.ndarray, first: np.ndarray) -> float:
        return float(self.stiffness[2] * (second[0] - first[0]) + self.damping[2] * (second[1] - first[1]))

    def _law(self, body: Body, inputs: tuple[str, ...], outputs: list[str]) -> Any:
        def law(end: Any, state: Any, time: float, size: float, begin: Any) -> dict[str, float]:
            loads = [
                float(values[inputs[0]])
                if len(inputs) == 1
                else body.load(np.array([float(values[name]) for name in inputs]))
                for values in (begin, end)
            ]
            x, v = body.step(np.array([float(state[outputs[0]]), float(state[outputs[1]])]), *loads, size)
            result = {outputs[0]: x, outputs[1]: v}
            if "F" in outputs:
                result["F"] = self._force(np.array([x, v]), np.array([float(end[name]) for name in inputs]))
            return result

        return law

    # --- theory -------------------------------------------------------------------------------------------------------

    def amplification(self, split: str, scheme: str, order: int, size: float) -> np.ndarray:
        """The matrix that takes one exchange to the next: both states, the inputs, and the inputs before.

        Order 0 holds inputs; order 1 extrapolates them linearly, and interpolates what is known.
        """
        first, second = self.bodies(split)

        def advance(z: np.ndarray) -> np.ndarray:
            one, two, force, before_one, before_two, before_force = z[:2], z[2:4], z[4], z[5:7], z[7:9], z[9]

            def extrapolated(now: Any, before: Any) -> Any:
                return now if order == 0 else 2.0 * now - before

            # Mass 1 goes first and knows nothing of the step's end.
            if split == "FD":
                ends = extrapolated(force, before_force)
                loads = (ends if order == 0 else force, ends)
            else:
                ends = extrapolated(two, before_two)
                loads = (first.load(ends if order == 0 else two), first.load(ends))
            new_one = first.step(one, *loads, size)
            seen = new_one if scheme == "gauss-seidel" else extrapolated(one, before_one)
            new_two = second.step(two, second.load(seen if order == 0 else one), second.load(seen), size)
            return np.array([*new_one, *new_two, self._force(new_two, seen), *one, *two, force])

        return np.stack([advance(column) for column in np.eye(10)], axis=1)

    def first_unstable(self, split: str, scheme: str, order: int, scan: np.ndarray) -> float | None:
        """The first step size of an unstable range along `scan`, by bisection; None if there is none."""

        def radius(size: float) -> float:
            return float(np.abs(np.linalg.eigvals(self.amplification(split, scheme, order, size))).max())

        unstable = [size for size in scan if radius(size) > 1.0 + 1e-12]
        if not unstable:
            return None
        high = unstable[0]
        low = max(scan[scan < high], default=0.0)
        for _ in range(40):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if radius(middle) > 1.0 + 1e-12 else (middle, high)
        return float(high)
