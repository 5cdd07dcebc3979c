"""The figures of a run, drawn from what it left in its results folder."""

from .draw import draw_figures

__all__ = ["draw_figures"]
