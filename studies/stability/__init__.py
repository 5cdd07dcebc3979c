"""Maps of where a coupled run is sound: its class in every cell, and the boundary that theory predicts."""

from .map import Cell, Crossing, Panel, StabilityMap
from .map_files import write_map
from .mapped import map_study
from .plan_map import plan_map

__all__ = ["Cell", "Crossing", "Panel", "StabilityMap", "map_study", "plan_map", "write_map"]
