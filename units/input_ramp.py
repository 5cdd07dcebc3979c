"""How a unit sees an input inside a step: held at the value set, or ramped to it from that of the step before.

Held inputs make any coupling first order in the communication step; ramped ones make it second order where the value
set is that of the step's end. PythonFMU has no input derivatives (fmi2SetRealInputDerivatives), so the unit ramps by
itself: from the values its inputs had in the last step to those set since. A step of zero length moves the ramp's
begin to the values that are set, for a master that knows better what an input was.
"""

from dataclasses import dataclass

from .variable import parameter

#: The name of the parameter, by which a master recognises a unit that can ramp its inputs.
INPUT_INTERPOLATION = "input_interpolation"


@dataclass(frozen=True)
class InputRamp:
    """Held or ramped inputs."""

    input_interpolation: str = parameter(
        "hold",
        "1",
        "hold: inputs keep the value set over a step; linear: they run to it from the value of the step before",
        choices=("hold", "linear"),
    )
