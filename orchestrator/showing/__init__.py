"""What a scenario is, shown before anything runs: in words, as a graph, and by its parameters."""

from .assembled import assembled
from .description import describe
from .graph import Graph, graph_of
from .parameter_table import parameter_table

__all__ = ["Graph", "assembled", "describe", "graph_of", "parameter_table"]
