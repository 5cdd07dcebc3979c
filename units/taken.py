"""The step that a unit has taken: what its present state was computed from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from .arrays import FloatArray


@dataclass(frozen=True)
class Taken:
    """The last step, or the initialisation, of which derivatives are taken.

    `before` is the state at its begin, which the initialisation has not; inputs ran from `begin` to `inputs`, which are
    one object where they were held. `time` and `step` are in ms. The arrays are those of the unit: it costs references.
    """

    before: Mapping[str, FloatArray]
    begin: Mapping[str, FloatArray]
    inputs: Mapping[str, FloatArray]
    time: float
    step: float

    @classmethod
    def initially(cls, inputs: Mapping[str, FloatArray]) -> "Taken":
        """The initialisation with `inputs`."""
        return cls({}, inputs, inputs, 0.0, 0.0)

    @property
    def held(self) -> bool:
        """Whether no input had another end."""
        return self.begin is self.inputs

    def groups(self) -> Iterator[tuple[str, Mapping[str, FloatArray]]]:
        """Its arrays in groups, the begin only where it is another."""
        yield "before", self.before
        yield "inputs", self.inputs
        if not self.held:
            yield "begin", self.begin
