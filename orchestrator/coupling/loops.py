"""The loops of a connection graph, and the order in which units can be taken so that only loops are left."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from .connections import Connection


@dataclass(frozen=True)
class Group:
    """Units that feed each other in a circle (`is_loop`), or a single unit, in the order given."""

    units: tuple[str, ...]
    is_loop: bool


def groups_in_order(units: Iterable[str], connections: Iterable[Connection]) -> list[Group]:
    """`units` in groups, each after those that feed it; where the connections leave a choice, in the order given."""
    place = {unit: number for number, unit in enumerate(units)}
    links = {(place[link.source.unit], place[link.target.unit]) for link in connections if _within(link, place)}
    sources, targets = ([link[side] for link in links] for side in (0, 1))
    graph = coo_matrix((np.ones(len(links)), (sources, targets)), shape=(len(place), len(place)))
    _, circle = connected_components(graph, connection="strong")
    members: dict[int, list[str]] = {}
    for unit, number in zip(place, circle.tolist(), strict=True):
        members.setdefault(number, []).append(unit)
    feeding: dict[int, set[int]] = {number: set() for number in members}
    for source, target in links:
        feeding[int(circle[target])].add(int(circle[source]))
    order: list[Group] = []
    while members:
        # The dictionary is in the order given; a circle that nothing outside of it feeds is there as long as any is.
        first = next(number for number in members if feeding[number].isdisjoint(members.keys() - {number}))
        group = members.pop(first)
        order.append(Group(tuple(group), len(group) > 1 or (place[group[0]],) * 2 in links))
    return order


def _within(link: Connection, place: Mapping[str, int]) -> bool:
    return link.source.unit in place and link.target.unit in place


def inside(group: Sequence[str], connections: Iterable[Connection]) -> list[Connection]:
    """The connections by which the units of a group feed each other."""
    return [link for link in connections if link.source.unit in group and link.target.unit in group]
