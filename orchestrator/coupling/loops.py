"""The loops of a connection graph, and the order in which units can be taken so that only loops are left."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import networkx as nx

from .connections import Connection


@dataclass(frozen=True)
class Group:
    """Units that feed each other in a circle (`is_loop`), or a single unit, in the order given."""

    units: tuple[str, ...]
    is_loop: bool


def groups_in_order(units: Iterable[str], connections: Iterable[Connection]) -> list[Group]:
    """`units` in groups, each after those that feed it; where the connections leave a choice, in the order given."""
    place = {unit: number for number, unit in enumerate(units)}
    graph = nx.DiGraph()
    graph.add_nodes_from(place)
    links = ((link.source.unit, link.target.unit) for link in connections)
    graph.add_edges_from((source, target) for source, target in links if source in place and target in place)
    condensed = nx.condensation(graph)
    order = nx.lexicographical_topological_sort(
        condensed, key=lambda number: min(place[unit] for unit in condensed.nodes[number]["members"])
    )
    members = [tuple(sorted(condensed.nodes[number]["members"], key=place.__getitem__)) for number in order]
    return [Group(group, len(group) > 1 or graph.has_edge(group[0], group[0])) for group in members]


def inside(group: Sequence[str], connections: Iterable[Connection]) -> list[Connection]:
    """The connections by which the units of a group feed each other."""
    return [link for link in connections if link.source.unit in group and link.target.unit in group]
