"""Electrophysiology: the monodomain equation, its ionic model, its time scale and its stimulus."""

from .unit import Electrophysiology

__all__ = ["Electrophysiology"]
