"""A unit as the slave of the wrapper (`wrapper/`), for both versions of FMI: what runs inside an FMU.

Every method returns (status, value, messages) and raises nothing. What the caller got wrong is an error, and nothing
has changed then: the instance goes on as if the call had not been. Numbers that could not be read are NaN, for hosts
that do not look at the status. A step that the physics cannot do is discarded and leaves the unit as it was.
"""

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np

from ..units.errors import StepFailure
from .instance import UnitInstance
from .messages import WARNING_CATEGORY, category, message
from .saved_state import SavedState

#: fmi2Status and fmi3Status.
OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

#: Of the numbers of a type, how they cross; FMI 2.0 has Booleans of four bytes.
_NUMBERS: dict[str, type] = {"Real": np.float64, "Integer": np.int32, "Float64": np.float64, "Float32": np.float32}
_NUMBERS |= {"Int8": np.int8, "Int16": np.int16, "Int32": np.int32, "Int64": np.int64}
_NUMBERS |= {"UInt8": np.uint8, "UInt16": np.uint16, "UInt32": np.uint32, "UInt64": np.uint64}

Answer = tuple[int, Any, list[tuple[int, str, str]]]

_FINE: Answer = (OK, None, [])


class Slave:
    """The slave of the unit `name`, on the mesh in the folder `resources`, for the version `fmi` of the standard."""

    def __init__(self, name: str, resources: str, fmi: int) -> None:
        self._instance = UnitInstance(name, resources, fmi)
        self._boolean: type = np.int32 if fmi == 2 else np.bool_

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def setup_experiment(self, start: float, stop: float) -> Answer:
        """fmi2SetupExperiment; a stop time that is not defined is infinite."""
        return _answered(lambda: self._instance.setup_experiment(start, stop))

    def enter_initialization_mode(self, start: float | None = None, stop: float = inf) -> Answer:
        """fmi2EnterInitializationMode, and fmi3EnterInitializationMode, which has the times of the experiment."""

        def enter() -> None:
            if start is not None:
                self._instance.setup_experiment(start, stop)
            self._instance.enter_initialization_mode()

        return _answered(enter)

    def exit_initialization_mode(self) -> Answer:
        """fmi2ExitInitializationMode and fmi3ExitInitializationMode."""
        return _answered(self._instance.exit_initialization_mode)

    def prepare_step(self, time: float, size: float) -> Answer:
        """Before the intermediate update of a step: whether there may be such a step."""
        return _answered(lambda: self._instance.prepare_step(time, size))

    def do_step(self, time: float, size: float) -> Answer:
        """fmi2DoStep and fmi3DoStep."""
        try:
            self._instance.do_step(time, size)
        except StepFailure as error:
            return DISCARD, None, [(ERROR, category(error), message(error))]
        except Exception as error:
            return _refused(error)
        return _FINE

    def reached(self) -> Answer:
        """The time in s that the instance has come to."""
        return OK, self._instance.clock.time, []

    def terminate(self) -> Answer:
        """fmi2Terminate and fmi3Terminate."""
        return _answered(self._instance.terminate)

    def reset(self) -> Answer:
        """fmi2Reset and fmi3Reset."""
        return _answered(self._instance.reset)

    # --- values -------------------------------------------------------------------------------------------------------

    def set_numbers(self, fmi_type: str, references: memoryview, values: memoryview) -> Answer:
        """fmi2SetReal, fmi3SetFloat64 and so on: whole fields at once, or any scalars."""
        return _answered(
            lambda: self._instance.set_numbers(fmi_type, _references(references), self._numbers(fmi_type, values))
        )

    def get_numbers(self, fmi_type: str, references: memoryview, values: memoryview) -> Answer:
        """fmi2GetReal, fmi3GetFloat64 and so on: whole fields at once, or any scalars."""
        target = self._numbers(fmi_type, values)
        warnings: list[str] = []

        def read() -> None:
            found, told = self._instance.get_numbers(fmi_type, _references(references), len(target))
            target[:] = found
            warnings.extend(told)

        answer = _answered(read)
        if answer[0] == ERROR:
            target[:] = _nothing(target.dtype)
        elif warnings:
            return WARNING, None, [(WARNING, WARNING_CATEGORY, text) for text in warnings]
        return answer

    def set_strings(self, references: memoryview, values: list[str]) -> Answer:
        """fmi2SetString and fmi3SetString."""
        return _answered(lambda: self._instance.set_texts(_references(references), values))

    def get_strings(self, references: memoryview) -> Answer:
        """fmi2GetString and fmi3GetString; the value is a list of bytes in UTF-8."""
        return _valued(lambda: [text.encode() for text in self._instance.get_texts(_references(references))])

    def refuse_type(self, fmi_type: str, references: memoryview) -> Answer:
        """The setters and getters of binaries and clocks."""
        return _answered(lambda: self._instance.refuse_type(fmi_type, _references(references)))

    def set_input_derivatives(self, references: memoryview, orders: memoryview, values: memoryview) -> Answer:
        """fmi2SetRealInputDerivatives."""
        return _answered(
            lambda: self._instance.set_derivatives(
                _references(references), np.frombuffer(orders, np.int32), np.frombuffer(values, np.float64)
            )
        )

    def set_at_end(self, references: memoryview, values: memoryview) -> Answer:
        """fmi3SetFloat64 in an intermediate update."""
        return _answered(lambda: self._instance.set_at_end(_references(references), np.frombuffer(values, np.float64)))

    def get_directional_derivative(
        self, unknowns: memoryview, knowns: memoryview, seed: memoryview, sensitivity: memoryview
    ) -> Answer:
        """fmi2GetDirectionalDerivative and fmi3GetDirectionalDerivative."""
        return _derived(self._instance.directional_derivative, unknowns, knowns, seed, sensitivity)

    def get_adjoint_derivative(
        self, unknowns: memoryview, knowns: memoryview, seed: memoryview, sensitivity: memoryview
    ) -> Answer:
        """fmi3GetAdjointDerivative."""
        return _derived(self._instance.adjoint_derivative, unknowns, knowns, seed, sensitivity)

    # --- state --------------------------------------------------------------------------------------------------------

    def get_state(self) -> Answer:
        """fmi2GetFMUstate and fmi3GetFMUState."""
        return _valued(self._instance.get_state)

    def set_state(self, state: object) -> Answer:
        """fmi2SetFMUstate and fmi3SetFMUState."""
        return _answered(lambda: self._instance.set_state(state))

    def state_to_bytes(self, state: SavedState) -> Answer:
        """fmi2SerializeFMUstate and fmi3SerializeFMUState."""
        return _valued(state.to_bytes)

    def state_from_bytes(self, data: bytes) -> Answer:
        """fmi2DeSerializeFMUstate and fmi3DeserializeFMUState."""
        return _valued(lambda: SavedState.from_bytes(data))

    # --- inside -------------------------------------------------------------------------------------------------------

    def _numbers(self, fmi_type: str, values: memoryview) -> np.ndarray:
        return np.frombuffer(values, _NUMBERS.get(fmi_type, self._boolean))


def _references(view: memoryview) -> np.ndarray:
    return np.frombuffer(view, np.uint32)


def _nothing(kind: np.dtype) -> Any:
    """What a number reads as that could not be read."""
    if kind.kind == "f":
        return np.nan
    return 0 if kind.kind == "b" else np.iinfo(kind).min


def _derived(
    product: Callable[[np.ndarray, np.ndarray, np.ndarray, int], np.ndarray],
    unknowns: memoryview,
    knowns: memoryview,
    seed: memoryview,
    sensitivity: memoryview,
) -> Answer:
    target = np.frombuffer(sensitivity, np.float64)

    def derive() -> None:
        target[:] = product(_references(unknowns), _references(knowns), np.frombuffer(seed, np.float64), len(target))

    answer = _answered(derive)
    if answer[0] == ERROR:
        target[:] = np.nan
    return answer


def _answered(call: Callable[[], object]) -> Answer:
    try:
        call()
    except Exception as error:
        return _refused(error)
    return _FINE


def _valued(call: Callable[[], object]) -> Answer:
    try:
        return OK, call(), []
    except Exception as error:
        return _refused(error)


def _refused(error: Exception) -> Answer:
    return ERROR, None, [(ERROR, category(error), message(error))]
