"""The connections of a system package: arrays of FMI 3.0 as they are, scalars put together to fields that they fill."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..coupling.connections import Connection, End, Law
from ..errors import InputError
from ..participants.participant import Port
from .connector import fits, written
from .wiring import Hop, Wiring


def connections(wiring: Wiring) -> Iterator[Connection]:
    """The connections between fields of components, however many systems lie between.

    Fields that are connected in part, in another order or by several laws are connected element by element.

    Raises
    ------
    InputError
        For transformations other than linear ones, units of measure that cannot be converted, shapes that differ, and
        parameters that an output feeds.
    """
    fields: dict[tuple[End, End], list[_Pair]] = {}
    ports: dict[End, Port] = {}
    for target, pin, hops in wiring.fed():
        start = hops[0].source
        # What nobody feeds keeps a value: that is no connection.
        if start.path not in wiring.components:
            continue
        source = wiring.components[start.path]
        if pin.name not in target.pins:
            raise InputError(f"the parameter {pin} is connected to the output {start}; parameters keep their values")
        _check_shapes(wiring, hops, source.variables[start.name].shape, target.variables[pin.name].shape)
        (output, at), (taken, place) = source.pins[start.name], target.pins[pin.name]
        law = wiring.law(hops, source.measure(start.name), source.is_relative(start.name))
        ends = End(source.unit, output.name), End(target.unit, taken.name)
        ports |= {ends[0]: output, ends[1]: taken}
        fields.setdefault(ends, []).append(_Pair(start.name, at, pin.name, place, law))
    for (begin, end), pairs in fields.items():
        laws = {pair.law for pair in pairs}
        in_order = all(pair.at == pair.place for pair in pairs)
        if ports[begin].shape == ports[end].shape and len(pairs) == ports[end].size and in_order and len(laws) == 1:
            yield Connection(begin, end, laws.pop())
            continue
        for pair in pairs:
            yield Connection(End(begin.unit, pair.output), End(end.unit, pair.input), pair.law)


def _check_shapes(wiring: Wiring, hops: Sequence[Hop], shape: tuple[int, ...], taken: tuple[int, ...]) -> None:
    """InputError if an output of `shape` does not fit into an input of the shape `taken`, or on the way there."""
    start, end = hops[0].source, hops[-1].target
    for pin in (hop.target for hop in hops[:-1]):
        said = wiring.sizes(pin)
        if said and not fits(shape, said):
            raise InputError(
                f"the connection of {start} to {end}: the connector {pin} on the way is {written(said)}, but "
                f"the output {written(shape)}; correct the dimensions of the connector"
            )
    if shape != taken:
        raise InputError(
            f"the connection of {start} to {end}: the shapes differ, {written(shape)} -> {written(taken)}; connect "
            "arrays of one shape, for instance of FMUs that were built for the same mesh"
        )


@dataclass(frozen=True)
class _Pair:
    """One connection: of variables by their names and places in their fields; an array of FMI 3.0 has none."""

    output: str
    at: int | None
    input: str
    place: int | None
    law: Law | None
