"""The connections of a system package, scalar by scalar, put together to those of whole fields where they are some."""

from collections.abc import Iterator
from dataclasses import dataclass

from ..coupling.connections import Connection, End, Law
from ..errors import InputError
from ..participants.participant import Port
from .wiring import Wiring


def connections(wiring: Wiring) -> Iterator[Connection]:
    """The connections between fields of components, however many systems lie between.

    Fields that are connected in part, in another order or by several laws are connected element by element.

    Raises
    ------
    InputError
        For transformations other than linear ones, units of measure that cannot be converted, and parameters that an
        output feeds.
    """
    fields: dict[tuple[End, End], list[_Scalar]] = {}
    ports: dict[End, Port] = {}
    for target, pin, hops in wiring.fed():
        start = hops[0].source
        # What nobody feeds keeps a value: that is no connection.
        if start.path not in wiring.components:
            continue
        source = wiring.components[start.path]
        if pin.name not in target.scalars:
            raise InputError(f"the parameter {pin} is connected to the output {start}; parameters keep their values")
        (output, at), (taken, place) = source.scalars[start.name], target.scalars[pin.name]
        law = wiring.law(hops, source.measure(start.name), source.is_relative(start.name))
        ends = End(source.unit, output.name), End(target.unit, taken.name)
        ports |= {ends[0]: output, ends[1]: taken}
        fields.setdefault(ends, []).append(_Scalar(start.name, at, pin.name, place, law))
    for (begin, end), scalars in fields.items():
        laws = {scalar.law for scalar in scalars}
        in_order = all(scalar.at == scalar.place for scalar in scalars)
        if ports[begin].shape == ports[end].shape and len(scalars) == ports[end].size and in_order and len(laws) == 1:
            yield Connection(begin, end, laws.pop())
            continue
        for scalar in scalars:
            yield Connection(End(begin.unit, scalar.output), End(end.unit, scalar.input), scalar.law)


@dataclass(frozen=True)
class _Scalar:
    """One connection: of the output's and the input's element, by their names and places in their fields."""

    output: str
    at: int
    input: str
    place: int
    law: Law | None
