"""The connections of a system package, scalar by scalar, put together to those of whole fields."""

from collections.abc import Iterator

from ..coupling.connections import Connection, End, Law
from ..errors import InputError
from ..participants.participant import Port
from .wiring import Wiring


def connections(wiring: Wiring) -> Iterator[Connection]:
    """The connections between fields of components, however many systems lie between.

    Raises
    ------
    InputError
        For transformations other than linear ones, units of measure that cannot be converted, parameters that an output
        feeds, and fields that are connected in part only, or in another order.
    """
    fields: dict[tuple[End, End], tuple[Port, Port, dict[int, tuple[int, Law | None]]]] = {}
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
        places = fields.setdefault((End(source.unit, output.name), End(target.unit, taken.name)), (output, taken, {}))
        places[2][place] = (at, law)
    for (begin, end), (output, taken, places_of_field) in fields.items():
        laws = {law for _, law in places_of_field.values()}
        in_order = all(at == place for place, (at, _) in places_of_field.items())
        if output.shape != taken.shape or len(places_of_field) != taken.size or not in_order or len(laws) != 1:
            raise InputError(
                f"the connection {begin} -> {end} is not of the whole field, element by element in the same way; "
                "arrays can only be connected as a whole"
            )
        yield Connection(begin, end, laws.pop())
