"""A unit as an instance of its FMU: FMI's calls with value references, in NumPy arrays; what is wrong is raised.

What the wrapper makes of exceptions is said in `slave`.
"""

from collections.abc import Callable, Mapping, Sequence
from math import inf, prod
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..units.arrays import FloatArray
from ..units.errors import InvalidInput, StepFailure
from ..units.mesh.archive import unpack_mesh
from ..units.phase import Phase
from ..units.registry import UNITS
from ..units.variable import Causality
from .clock import Clock
from .coordinates import Coordinates, coordinates
from .layout import TIME, Run, layout
from .references import ArrayReferences, Piece, References, ScalarReferences
from .saved_state import SavedState

MESH_FILE = "mesh.npz"

_Result = TypeVar("_Result")


class UnitInstance:
    """The unit `name` on the mesh in the folder `resources`, in the version `fmi` of the standard, 2 or 3.

    Whole fields move in one piece. Inputs that are set in parts are collected, and given to the unit before it needs
    them. All methods raise InvalidInput for what the caller got wrong, and nothing has changed then.
    """

    def __init__(self, name: str, resources: str, fmi: int) -> None:
        mesh = unpack_mesh(Path(resources) / MESH_FILE)
        self.unit = UNITS[name](mesh)
        self.clock = Clock()
        self._fmi = fmi
        kind = type(self.unit)
        runs = layout(kind, mesh)
        self._references: References = (
            ScalarReferences(name, runs) if fmi == 2 else ArrayReferences(name, (*runs, *coordinates(kind, mesh)))
        )
        self._staged: dict[str, FloatArray] = {}
        self._read: dict[str, FloatArray] = {}
        # For the next step: time derivatives of inputs in 1/s (FMI 2.0), or their values at its end (FMI 3.0).
        self._derivatives: dict[str, FloatArray] = {}
        self._ends: dict[str, FloatArray] = {}

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def setup_experiment(self, start: float, stop: float) -> None:
        """fmi2SetupExperiment; times in s, and a stop time that is not defined is infinite."""
        clock = Clock(start, stop)
        self.unit.setup_experiment(start, None if stop == inf else stop)
        self.clock = clock

    def enter_initialization_mode(self) -> None:
        """fmi2EnterInitializationMode and fmi3EnterInitializationMode."""
        self._advance(self.unit.enter_initialization_mode)

    def exit_initialization_mode(self) -> None:
        """fmi2ExitInitializationMode and fmi3ExitInitializationMode."""
        self._advance(self.unit.exit_initialization_mode)

    def check_step(self, time: float, size: float) -> None:
        """InvalidInput for a step that FMI does not allow at present."""
        if self.unit.phase is Phase.STEPPING:
            self.clock.check(time, size)
        else:
            raise InvalidInput(
                f"unit '{self.unit.name}' is {self.unit.phase.value}; it steps between the end of its initialization "
                "and its termination only"
            )

    def prepare_step(self, time: float, size: float) -> None:
        """Before an intermediate update gives inputs at the end of a step; InvalidInput if there is no such step."""
        self.check_step(time, size)
        # What was given for a step that was not taken then.
        self._ends = {}

    def do_step(self, time: float, size: float) -> None:
        """fmi2DoStep and fmi3DoStep; StepFailure leaves the state as it was."""
        self.check_step(time, size)
        ends, self._ends = self._ends, {}
        for name, derivative in self._derivatives.items():
            ends[name] = self._current(name) + size * derivative.reshape(self._shape(name))
        self._advance(lambda: self.unit.do_step(time, size, ends))
        self._derivatives = {}
        self.clock = Clock(time + size, max(self.clock.stop, time + size))

    def terminate(self) -> None:
        """fmi2Terminate and fmi3Terminate."""
        self.unit.terminate()

    def reset(self) -> None:
        """fmi2Reset and fmi3Reset."""
        self._forget()
        self.clock = Clock()
        self.unit.reset()

    # --- values -------------------------------------------------------------------------------------------------------

    def set_numbers(self, fmi_type: str, references: np.ndarray, values: np.ndarray) -> None:
        """fmi2SetReal, fmi3SetFloat64 and so on; the arrays, shapes (references,) and (values,), are the caller's.

        Of a call that is refused nothing is taken.
        """
        pieces = self._pieces(fmi_type, references, len(values))
        for piece in pieces:
            if piece.run is TIME:
                raise InvalidInput("'time' can only be read, because it advances with the steps")
            variable = self.unit.settable(piece.run.variable.name)
            if variable.causality is Causality.PARAMETER:
                variable.checked(values[piece.at].tolist()[0])
            else:
                self._check_input(piece, values[piece.at])
        for piece in pieces:
            self._take(piece, values[piece.at])

    def get_numbers(self, fmi_type: str, references: np.ndarray, count: int) -> tuple[np.ndarray, list[str]]:
        """fmi2GetReal, fmi3GetFloat64 and so on: `count` values, and warnings of those that there are not yet."""
        pieces = self._pieces(fmi_type, references, count)
        self._flush()
        warnings: list[str] = []
        if len(pieces) == 1 and pieces[0].places is None:
            return self._values(pieces[0].run, warnings), warnings
        values = np.empty(count)
        for piece in pieces:
            own = self._values(piece.run, warnings)
            values[piece.at] = own if piece.places is None else own[piece.places]
        return values, warnings

    def set_texts(self, references: np.ndarray, values: Sequence[str]) -> None:
        """fmi2SetString and fmi3SetString: parameters that choose between named options."""
        names = self._texts(references)
        if len(names) != len(values):
            raise InvalidInput(f"{len(values)} texts were given for {len(names)} variables ({', '.join(names)})")
        chosen = dict(zip(names, values, strict=True))
        for name, value in chosen.items():
            self.unit.settable(name).checked(value)
        self._forget_foreseen()
        for name, value in chosen.items():
            self.unit.set(name, value)

    def get_texts(self, references: np.ndarray) -> list[str]:
        """fmi2GetString and fmi3GetString."""
        return [str(self.unit.get(name)) for name in self._texts(references)]

    def refuse_type(self, fmi_type: str, references: np.ndarray) -> None:
        """InvalidInput for a type that no unit has, with the one that the first variable is of."""
        self._pieces(fmi_type, references, None)
        raise InvalidInput(f"unit '{self.unit.name}' has no variables of the type {fmi_type}")

    # --- inputs inside a step -----------------------------------------------------------------------------------------

    def set_derivatives(self, references: np.ndarray, orders: np.ndarray, values: np.ndarray) -> None:
        """fmi2SetRealInputDerivatives, of order 1 and per s; they hold for the next step that is completed."""
        self._require_interpolation("canInterpolateInputs")
        if (orders != 1).any():
            raise InvalidInput(
                f"unit '{self.unit.name}' takes the first time derivatives of its inputs, not those of order "
                f"{orders[orders != 1][0]}"
            )
        pieces = self._pieces("Real", references, len(values))
        for piece in pieces:
            variable = self._moving(piece.run)
            if not np.isfinite(values[piece.at]).all():
                raise InvalidInput(f"the time derivative of '{variable.name}' is not finite")
        for piece in pieces:
            whole = self._derivatives.get(piece.run.variable.name, np.zeros(piece.run.size)).copy()
            whole[slice(None) if piece.places is None else piece.places] = values[piece.at]
            self._derivatives = self._derivatives | {piece.run.variable.name: whole}

    def set_at_end(self, references: np.ndarray, values: np.ndarray) -> None:
        """fmi3SetFloat64 in an intermediate update: values of inputs at the end of the step that is being done."""
        self._require_interpolation("providesIntermediateUpdate")
        pieces = self._pieces("Float64", references, len(values))
        for piece in pieces:
            self._moving(piece.run)
            self._check_input(piece, values[piece.at])
        for piece in pieces:
            self._ends[piece.run.variable.name] = np.array(values[piece.at]).reshape(piece.run.shape)

    # --- derivatives of outputs by inputs -----------------------------------------------------------------------------

    def directional_derivative(
        self, unknowns: np.ndarray, knowns: np.ndarray, seed: np.ndarray, count: int
    ) -> np.ndarray:
        """fmi2GetDirectionalDerivative and fmi3GetDirectionalDerivative: `count` changes of `unknowns` along `seed`."""
        return self._product(self.unit.directional_derivative, knowns, seed, unknowns, count)

    def adjoint_derivative(self, unknowns: np.ndarray, knowns: np.ndarray, seed: np.ndarray, count: int) -> np.ndarray:
        """fmi3GetAdjointDerivative: `count` gradients by `knowns` of the unknowns weighted with `seed`."""
        return self._product(self.unit.adjoint_derivative, unknowns, seed, knowns, count)

    def _product(
        self,
        product: Callable[[Mapping[str, FloatArray]], Mapping[str, FloatArray]],
        given: np.ndarray,
        seed: np.ndarray,
        wanted: np.ndarray,
        count: int,
    ) -> np.ndarray:
        real = "Real" if self._fmi == 2 else "Float64"
        sources, targets = self._pieces(real, given, len(seed)), self._pieces(real, wanted, count)
        self._flush()
        seeds: dict[str, FloatArray] = {}
        for piece in sources:
            whole = seeds.setdefault(piece.run.variable.name, np.zeros(piece.run.size))
            whole[slice(None) if piece.places is None else piece.places] += seed[piece.at]
        shaped = {name: values.reshape(self._shape(name)) for name, values in seeds.items()}
        found, result = product(shaped), np.empty(count)
        for piece in targets:
            name = piece.run.variable.name
            if name not in found:
                raise InvalidInput(f"unit '{self.unit.name}' has no derivative of or with respect to '{name}'")
            own = np.asarray(found[name]).reshape(-1)
            result[piece.at] = own if piece.places is None else own[piece.places]
        return result

    # --- state --------------------------------------------------------------------------------------------------------

    def get_state(self) -> SavedState:
        """fmi2GetFMUstate and fmi3GetFMUState: parameters and inputs are part of it."""
        self._flush()
        return SavedState(self.unit.get_state(), self.clock, self._derivatives)

    def set_state(self, state: object) -> None:
        """fmi2SetFMUstate and fmi3SetFMUState."""
        if not isinstance(state, SavedState):
            raise InvalidInput("the given state is not a state of this FMU")
        if any(values.shape != (prod(self._shape(name)),) for name, values in state.derivatives.items()):
            raise InvalidInput(f"the input derivatives of the state do not fit unit '{self.unit.name}'")
        self.unit.set_state(state.snapshot)
        self._forget()
        self.clock, self._derivatives = state.clock, dict(state.derivatives)

    # --- inside -------------------------------------------------------------------------------------------------------

    def _pieces(self, fmi_type: str, references: np.ndarray, count: int | None) -> Sequence[Piece]:
        """What `references` mean: of the type that the caller took them for, with `count` values if that is known."""
        pieces = self._references.pieces(references)
        for piece in pieces:
            own = piece.run.type_in(self._fmi)
            if own != fmi_type:
                raise InvalidInput(f"'{piece.run.variable.name}' is of the type {own}, not {fmi_type}")
        size = sum(piece.size for piece in pieces)
        if count not in (None, size):
            names = ", ".join(f"'{piece.run.variable.name}'" for piece in pieces)
            raise InvalidInput(f"{count} values were given or requested; {names} have {size}")
        return pieces

    def _require_interpolation(self, capability: str) -> None:
        if not self.unit.interpolates:
            raise InvalidInput(f"unit '{self.unit.name}' keeps its inputs over a step ({capability} is false)")

    def _moving(self, run: Run) -> Any:
        """The variable of `run`, if it is an input that may change inside a step."""
        variable = self.unit.settable(run.variable.name)
        if variable.causality is not Causality.INPUT or variable.fixed:
            raise InvalidInput(f"'{variable.name}' of unit '{self.unit.name}' does not change inside a step")
        return variable

    def _check_input(self, piece: Piece, values: np.ndarray) -> None:
        variable = piece.run.variable
        self.unit.check_values(variable, values, piece.places)
        if variable.fixed and self.unit.phase is Phase.STEPPING:
            own = self._current(variable.name).ravel()
            if not np.array_equal(own if piece.places is None else own[piece.places], values):
                raise InvalidInput(f"input '{variable.name}' of unit '{self.unit.name}' is fixed after initialisation")

    def _take(self, piece: Piece, values: np.ndarray) -> None:
        name = piece.run.variable.name
        self._forget_foreseen()
        self._read.pop(name, None)
        if piece.run.variable.causality is Causality.PARAMETER:
            self.unit.set(name, values.tolist()[0])
        elif piece.places is None:
            self._staged.pop(name, None)
            self.unit.set(name, np.array(values).reshape(piece.run.shape))
        else:
            if name not in self._staged:
                self._staged[name] = np.array(self.unit.get(name), dtype=float).ravel()
            self._staged[name][piece.places] = values

    def _flush(self) -> None:
        """Give the unit the inputs that were set in parts."""
        while self._staged:
            name, values = self._staged.popitem()
            self.unit.set(name, values.reshape(self._shape(name)))

    def _current(self, name: str) -> FloatArray:
        """An input as it is set, parts included."""
        return np.asarray(self._staged.get(name, self.unit.get(name))).reshape(self._shape(name))

    def _shape(self, name: str) -> tuple[int, ...]:
        return self.unit.variable(name).shape(self.unit.mesh)

    def _texts(self, references: np.ndarray) -> list[str]:
        """The variables of `references`, one by one, which have to be texts."""
        ones = (references[place : place + 1] for place in range(len(references)))
        return [self._pieces("String", one, None)[0].run.variable.name for one in ones]

    def _advance(self, call: Callable[[], _Result]) -> _Result:
        self._flush()
        self._read.clear()
        return call()

    def _forget(self) -> None:
        self._staged, self._read, self._derivatives, self._ends = {}, {}, {}, {}

    def _forget_foreseen(self) -> None:
        # During the initialization outputs follow whatever is set; afterwards they change in steps only.
        if self.unit.phase is Phase.INITIALIZATION:
            self._read.clear()

    def _values(self, run: Run, warnings: list[str]) -> np.ndarray:
        if run is TIME:
            return np.array([self.clock.time])
        if isinstance(run, Coordinates):
            return run.values
        name = run.variable.name
        if name not in self._read:
            value = self._output(name, warnings) if run.variable.causality is Causality.OUTPUT else self.unit.get(name)
            if value is None:
                return np.full(run.size, np.nan)
            self._read[name] = np.asarray(value, dtype=float).reshape(-1)
        return self._read[name]

    def _output(self, name: str, warnings: list[str]) -> Any:
        """An output; None, with a warning, if it has no value yet."""
        if self.unit.phase is Phase.INSTANTIATED:
            warnings.append(f"'{name}' has no value before the initialization; it reads as NaN")
            return None
        if self.unit.phase is not Phase.INITIALIZATION:
            return self.unit.get(name)
        try:
            return self.unit.get(name)
        except (InvalidInput, StepFailure) as error:
            warnings.append(
                f"'{name}' has no value as long as the initialization cannot end ({error}); it reads as NaN"
            )
            return None
