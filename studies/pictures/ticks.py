"""Ticks of logarithmic axes that are as few as can be read, and written as people write numbers."""

from math import ceil, floor, log10

from matplotlib.axis import Axis
from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

#: Axes of fewer decades than this have ticks at 1, 2 and 5; longer ones at some of the powers of ten.
_FEW = 1.8

#: Ticks of a long axis.
_MOST = 6

#: Powers of ten that are written out.
_PLAIN = range(-3, 5)


def set_ticks(axis: Axis, low: float, high: float) -> None:
    """Put the ticks of a logarithmic axis with these limits."""
    first, last = floor(log10(low)), ceil(log10(high))
    powers = range(first, last + 1)
    few = log10(high) - log10(low) < _FEW
    every = 1 if few else ceil((last - first) / _MOST)
    major = [
        float(f"{base}e{power}") for power in powers if power % every == 0 for base in ((1, 2, 5) if few else (1,))
    ]
    minor = [float(f"{base}e{power}") for power in powers for base in range(1, 10)] if len(powers) <= 2 * _MOST else []
    axis.set_major_locator(FixedLocator(_inside(major, low, high)))
    axis.set_minor_locator(FixedLocator(_inside([place for place in minor if place not in major], low, high)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: tick_text(value)))
    axis.set_minor_formatter(NullFormatter())


def tick_text(value: float) -> str:
    """A power of ten, or 2 or 5 times one, for Matplotlib."""
    base, _, power = f"{value:.0e}".partition("e")
    if int(power) in _PLAIN:
        return f"{value:g}"
    return rf"$10^{{{int(power)}}}$" if base == "1" else rf"${base}\cdot10^{{{int(power)}}}$"


def _inside(places: list[float], low: float, high: float) -> list[float]:
    return [place for place in places if low <= place <= high]
