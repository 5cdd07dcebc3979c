"""A loop of two delays, in closed form: why iterated held inputs can be worse than explicit Gauss–Seidel ones.

    A: a′ = ε (√g b − a),   B: b′ = ε (√g a − b)

The loop grows as e^(st) with s = ε (√g − 1), for √g > 1. With inputs held over steps of H, q = e^(−εH) and p = 1 − q,
each scheme multiplies the growing solution by a factor z per step instead of e^(sH). The units `response` of this
project are such delays, exact for inputs that are held or on a line: a run has these factors to the last digits.

`python docs/pictures/held_inputs.py` draws how far the growth rate ln(z)/H is from s (a second).
"""

from math import exp, expm1, log, sqrt
from pathlib import Path

import numpy as np
from canvas import BLACK, GREY, IMAGES, figure, save

#: ε in 1/ms and √g, the gain of either unit.
RATE, GAIN = 0.1, 2.0

#: s in 1/ms.
EXACT = RATE * (GAIN - 1.0)


def jacobi(step_ms: float) -> float:
    """Held; both inputs are of the step's beginning: z = q + p√g."""
    q = exp(-RATE * step_ms)
    return q + (1.0 - q) * GAIN


def gauss_seidel(step_ms: float) -> float:
    """Held; A's input is of the step's beginning, B's of its end: √z = ½ (p√g + √(p²g + 4q))."""
    q = exp(-RATE * step_ms)
    root = (1.0 - q) * GAIN
    return (0.5 * (root + sqrt(root**2 + 4.0 * q))) ** 2


def iterated(step_ms: float) -> float:
    """Held; both inputs are of the step's end: z = q/(1 − p√g)."""
    q = exp(-RATE * step_ms)
    return q / (1.0 - (1.0 - q) * GAIN)


def iterated_linear(step_ms: float) -> float:
    """Both inputs run from the beginning to the end: z = (q + (p − w)√g)/(1 − w√g), w = 1 − p/(εH)."""
    p = -expm1(-RATE * step_ms)
    end = 1.0 - p / (RATE * step_ms)
    return (1.0 - p + (p - end) * GAIN) / (1.0 - end * GAIN)


def growth_error(factor: float, step_ms: float) -> float:
    """By how much the growth rate is off, relative to it."""
    return (log(factor) / step_ms - EXACT) / EXACT


def draw(folder: Path = IMAGES) -> Path:
    """The error of the growth rate over the step."""
    picture = figure(3.6)
    axes = picture.add_subplot()
    steps = np.linspace(0.02, 2.0, 100)
    for scheme, label, style, place in (
        (iterated, "iterated, held", "-", 0.0),
        (iterated_linear, "iterated, linear", ":", 0.025),
        (gauss_seidel, "Gauss–Seidel, held", "--", -0.028),
        (jacobi, "Jacobi, held", "-.", 0.0),
    ):
        errors = 100.0 * np.array([growth_error(scheme(step), step) for step in steps])
        axes.plot(steps, errors, style, color=BLACK, linewidth=1.6)
        axes.text(2.05, errors[-1] + 100.0 * place, label, va="center", fontsize=9.5)
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    axes.set_xlim(0.0, 2.0)
    axes.set_xlabel("communication step $H$ in ms")
    axes.set_ylabel("error of the growth rate in %")
    return save(picture, "held_inputs", folder)


if __name__ == "__main__":
    print(draw())
    for step in (1.0, 0.5):
        errors = {
            one.__name__: growth_error(one(step), step) for one in (jacobi, gauss_seidel, iterated, iterated_linear)
        }
        print(f"H = {step} ms:", ", ".join(f"{name} {100.0 * error:+.2f} %" for name, error in errors.items()))
