"""The section `connections` of a scenario: who feeds whom."""

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from .section import Section


class ConnectionEntry(Section):
    """A connection written in its parts: for names that a text cannot hold unambiguously, and for programs.

    With `factor` or `offset` the input is given factor · value + offset, and whoever writes them answers for the units
    of measure.
    """

    source: Annotated[str, Field(alias="from", min_length=1)] = Field(
        description="The name of the unit whose output feeds the input."
    )
    output: Annotated[str, Field(min_length=1)] = Field(description="The name of the output of that unit.")
    target: Annotated[str, Field(alias="to", min_length=1)] = Field(
        description="The name of the unit whose input is fed."
    )
    input: Annotated[str, Field(min_length=1)] = Field(description="The name of the input of that unit.")
    factor: Annotated[float | None, Field(allow_inf_nan=False)] = Field(
        default=None,
        description="What the output's value is multiplied by on its way. Default: 1. With a `factor` or an `offset` "
        "the units of measure of the two ends are not compared.",
    )
    offset: Annotated[float | None, Field(allow_inf_nan=False)] = Field(
        default=None,
        description="What is added to the value after the multiplication, in the input's unit of measure. Default: 0.",
    )

    @property
    def law(self) -> tuple[float, float] | None:
        """Factor and offset; None where there are none."""
        if self.factor is None and self.offset is None:
            return None
        return (1.0 if self.factor is None else self.factor), self.offset or 0.0


#: How pydantic marks in which of its two forms a connection was read; no person has to see that.
AS_TEXT, AS_ENTRY = "[text]", "[entry]"


def _form(given: Any) -> str:
    """A mapping with none of the keys is a text that was broken at its colon."""
    is_entry = isinstance(given, ConnectionEntry) or (
        isinstance(given, Mapping) and not {"from", "output", "to", "input"}.isdisjoint(given)
    )
    return AS_ENTRY if is_entry else AS_TEXT


#: A connection as 'unit.output -> unit.input', or in its parts.
Written = Annotated[
    Annotated[str, Tag(AS_TEXT)] | Annotated[ConnectionEntry, Tag(AS_ENTRY)],
    Discriminator(_form),
]
