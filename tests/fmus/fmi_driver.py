"""A master that knows FMI 2.0 and 3.0 only: the model description, ctypes, and nothing of this project. Also run alone.

Every call keeps the status that it came back with, and every value is what a host finds in its own memory then.
"""

import ctypes
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar
from xml.etree import ElementTree

import numpy as np
from fmpy import extract, platform, platform_tuple, read_model_description, sharedLibraryExtension
from fmpy.fmi2 import (
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)
from fmpy.fmi3 import fmi3IntermediateUpdateCallback, fmi3LogMessageCallback

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3

#: Of both versions: FMI 2.0 has Booleans of four bytes (`Boolean` is replaced there).
_TYPES: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int32,
    "Float32": ctypes.c_float,
    "Float64": ctypes.c_double,
    "Boolean": ctypes.c_bool,
    "Clock": ctypes.c_bool,
    "String": ctypes.c_char_p,
}
_TYPES |= {f"Int{bits}": getattr(ctypes, f"c_int{bits}") for bits in (8, 16, 32, 64)}
_TYPES |= {f"UInt{bits}": getattr(ctypes, f"c_uint{bits}") for bits in (8, 16, 32, 64)}

#: A value that no FMU gives, so that it is seen whether a getter has written.
_UNTOUCHED = {ctypes.c_double: 123.25, ctypes.c_float: 123.25, ctypes.c_char_p: b"untouched", ctypes.c_bool: True}

_Size = ctypes.c_size_t


def drive(path: Any, instance: str = "driven", **rest: Any) -> "Driver":
    """An instance of the FMU at `path`, by the driver of its version."""
    return _DRIVERS[read_model_description(str(path), validate=False).fmiVersion[0]](path, instance, **rest)


class Driver:
    """One instance of one FMU; a field is a variable, of which FMI 2.0 declares every scalar by itself."""

    fmi: int
    #: The names of the types of variables, by those of Python.
    kinds: ClassVar[dict[type, str]]

    def __init__(self, path: Any, instance: str = "driven", logging: bool = True) -> None:
        self.description = read_model_description(str(path), validate=False)
        self.variables: dict[str, Any] = {}
        self._references: dict[str, list[int]] = {}
        for variable in self.description.modelVariables:
            name = variable.name.split("[")[0]
            self.variables.setdefault(name, variable)
            self._references.setdefault(name, []).append(variable.valueReference)
        #: (status, category, text) of every message, in order.
        self.messages: list[tuple[int, str, str]] = []
        #: (call, status) of every call but a step that came back with another status than OK or Warning.
        self.refused: list[tuple[str, int]] = []
        self.folder = str(extract(str(path), tempfile.mkdtemp(prefix="driver-")))
        self.identifier = self.description.coSimulation.modelIdentifier
        place = platform if self.fmi == 2 else platform_tuple
        self.dll = ctypes.CDLL(str(Path(self.folder) / "binaries" / place / (self.identifier + sharedLibraryExtension)))
        self.name = instance
        self.logging = logging
        self.component: Any = None
        self._times = (0.0, math.inf)
        self.instantiate()

    # --- life cycle ---------------------------------------------------------------------------------------------------

    def instantiate(self) -> None:
        """A new instance; Exception if there is none."""
        self.component = ctypes.c_void_p(self.made(self.name, self.description.guid))
        if not self.component:
            raise RuntimeError(f"no instance: {self.messages}")

    def made(self, name: str, token: str, **rest: Any) -> int | None:
        """What the function that instantiates returns."""
        raise NotImplementedError

    def free(self) -> None:
        self.function("FreeInstance")(self.component)
        self.component = None

    def close(self) -> None:
        if self.component:
            self.free()
        shutil.rmtree(self.folder, ignore_errors=True)

    def function(self, name: str) -> Any:
        return getattr(self.dll, f"fmi{self.fmi}{name}")

    def call(self, name: str, *arguments: Any) -> int:
        """The status of the function `name` with `arguments`, which are ctypes' own."""
        status: int = self.function(name)(self.component, *arguments)
        if status > WARNING and name != "DoStep":
            self.refused.append((name, status))
        return status

    def setup(self, start: float = 0.0, stop: float = math.inf) -> int:
        """Say when the experiment starts and stops."""
        raise NotImplementedError

    def enter(self) -> int:
        """Enter the initialization mode."""
        raise NotImplementedError

    def leave(self) -> int:
        """Exit the initialization mode."""
        return self.call("ExitInitializationMode")

    def terminate(self) -> int:
        return self.call("Terminate")

    def reset(self) -> int:
        return self.call("Reset")

    def start(self, parameters: Mapping[str, Any], inputs: Mapping[str, Any], stop: float = math.inf) -> None:
        """From instantiated to the first step."""
        self.parameterize(parameters)
        self.setup(0.0, stop)
        self.enter()
        for name, values in inputs.items():
            self.set(name, values)
        self.leave()

    def step(self, time: float, size: float, inputs: Mapping[str, Any] | None = None) -> int:
        """The status of the step."""
        for name, values in (inputs or {}).items():
            self.set(name, values)
        return self.advance(time, size)

    def advance(self, time: float, size: float) -> int:
        """The status of a step with the inputs as they are."""
        raise NotImplementedError

    def reached(self) -> float:
        """Time in s that the instance has come to, as it says itself."""
        raise NotImplementedError

    def errors(self) -> str:
        """The texts of all errors since the last time this was asked."""
        texts = [text for status, _, text in self.messages if status >= ERROR]
        self.messages.clear()
        return "\n".join(texts)

    # --- values -------------------------------------------------------------------------------------------------------

    def names(self, causality: str, moving: bool = False) -> list[str]:
        """The variables of one causality; only the `moving` ones, if that is asked for."""
        still = ("fixed", "constant", "discrete") if moving else ()
        found = self.variables.items()
        return [name for name, item in found if item.causality == causality and item.variability not in still]

    def references(self, name: str) -> list[int]:
        """All value references of a field."""
        return self._references[name]

    def size(self, name: str) -> int:
        """How many values it has."""
        raise NotImplementedError

    def type(self, kind: str) -> Any:
        """ctypes' type of the values of an FMI type."""
        return _TYPES[kind]

    def write(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> int:
        """fmi2SetReal, fmi3SetFloat64 and so on."""
        given = [value.encode() if isinstance(value, str) else value for value in values]
        array = (self.type(kind) * len(given))(*given)
        return self.call(f"Set{kind}", *_vr(references), array, *self._counted(kind, given))

    def read(self, kind: str, references: Sequence[int], count: int | None = None) -> list[Any]:
        """fmi2GetReal, fmi3GetFloat64 and so on, whatever the status: a host may not look at it."""
        number = len(references) if count is None else count
        blank = _UNTOUCHED.get(self.type(kind), 123)
        target = (self.type(kind) * number)(*[blank] * number)
        self.call(f"Get{kind}", *_vr(references), target, *self._counted(kind, target))
        return [value.decode() if isinstance(value, bytes) else value for value in target]

    def _counted(self, kind: str, values: Sequence[Any]) -> tuple[Any, ...]:
        """The number of values as an argument, where the version has that."""
        raise NotImplementedError

    def parameterize(self, parameters: Mapping[str, Any]) -> None:
        for name, value in parameters.items():
            self.write(self.variables[name].type, self.references(name), [value])

    def parameter(self, name: str) -> Any:
        """The value of a scalar of any type."""
        return self.read(self.variables[name].type, self.references(name))[0]

    def set(self, name: str, values: Any) -> int:
        return self.write(self.kinds[float], self.references(name), np.ravel(values).tolist())

    def get(self, *names: str) -> list[float]:
        """The values of the fields, one after the other."""
        references = [reference for name in names for reference in self.references(name)]
        return self.read(self.kinds[float], references, sum(map(self.size, names)))

    def outputs(self) -> dict[str, list[float]]:
        return {name: self.get(name) for name in self.names("output")}

    # --- states -------------------------------------------------------------------------------------------------------

    #: How the version spells the functions of states.
    state_calls: tuple[str, str, str, str, str, str]

    def save(self, state: Any = None) -> Any:
        """A state, in the place of `state` if one is given."""
        kept = ctypes.c_void_p() if state is None else state
        self.call(self.state_calls[0], ctypes.byref(kept))
        return kept

    def restore(self, state: Any) -> int:
        return self.call(self.state_calls[1], state)

    def release(self, state: Any) -> int:
        return self.call(self.state_calls[2], ctypes.byref(state))

    def pack(self, state: Any) -> bytes:
        """A state as bytes."""
        size = _Size()
        self.call(self.state_calls[3], state, ctypes.byref(size))
        stored = (ctypes.c_char * size.value)()
        self.call(self.state_calls[4], state, stored, size)
        return stored.raw

    def unpack(self, data: bytes) -> Any:
        """A state from bytes; an empty one where there is none."""
        state = ctypes.c_void_p()
        given = (ctypes.c_char * len(data)).from_buffer_copy(data)
        self.call(self.state_calls[5], given, _Size(len(data)), ctypes.byref(state))
        return state

    def packed(self) -> bytes:
        """The present state as bytes."""
        state = self.save()
        try:
            return self.pack(state)
        finally:
            self.release(state)

    # --- derivatives --------------------------------------------------------------------------------------------------

    def directional(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Any) -> list[float]:
        """Changes of `unknowns` along the changes `seed` of `knowns`; values of fields one after the other."""
        return self._derivative("GetDirectionalDerivative", unknowns, knowns, seed, unknowns)

    def _derivative(
        self, name: str, unknowns: Sequence[str], knowns: Sequence[str], seed: Any, wanted: Sequence[str]
    ) -> list[float]:
        references = [[vr for field in names for vr in self.references(field)] for names in (unknowns, knowns)]
        return self.derivative(name, *references, np.ravel(seed).tolist(), sum(map(self.size, wanted)))

    def derivative(
        self, name: str, unknowns: Sequence[int], knowns: Sequence[int], seed: Sequence[float], count: int
    ) -> list[float]:
        """The `count` numbers that the function `name` gives, by value references."""
        target = (ctypes.c_double * count)(*[_UNTOUCHED[ctypes.c_double]] * count)
        seeds = (ctypes.c_double * len(seed))(*seed)
        given, asked = self._counted("Float64", seed), self._counted("Float64", target)
        self.call(name, *_vr(unknowns), *_vr(knowns), seeds, *given, target, *asked)
        return list(target)


class Fmi2Driver(Driver):
    """FMI 2.0.4."""

    fmi = 2
    kinds: ClassVar[dict[type, str]] = {float: "Real", int: "Integer", str: "String"}
    state_calls = (
        "GetFMUstate",
        "SetFMUstate",
        "FreeFMUstate",
        "SerializedFMUstateSize",
        "SerializeFMUstate",
        "DeSerializeFMUstate",
    )

    def made(self, name: str, token: str, **rest: Any) -> int | None:
        """See Driver; `rest` may have the `location` of the resources and the `kind` of simulation."""
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        return self.instantiated(name, token, **rest)

    def instantiated(self, name: str, token: str, location: str | None = None, kind: int = 1) -> int | None:
        """See `made`; with the callbacks as they are."""
        place = (Path(self.folder) / "resources").as_uri() if location is None else location
        function = self.function("Instantiate")
        function.restype = ctypes.c_void_p
        result: int | None = function(
            name.encode(), kind, token.encode(), place.encode(), ctypes.byref(self.callbacks), 0, int(self.logging)
        )
        return result

    def _log(self, _environment: Any, _instance: bytes, status: int, category: bytes, message: bytes) -> None:
        # A message is a printf format, in which a percent sign is doubled.
        self.messages.append((status, (category or b"").decode(), message.decode().replace("%%", "%")))

    def setup(self, start: float = 0.0, stop: float = math.inf) -> int:
        ends = ctypes.c_int(stop < math.inf), ctypes.c_double(stop if stop < math.inf else 0.0)
        return self.call("SetupExperiment", 0, ctypes.c_double(0.0), ctypes.c_double(start), *ends)

    def enter(self) -> int:
        return self.call("EnterInitializationMode")

    def advance(self, time: float, size: float) -> int:
        return self.call("DoStep", ctypes.c_double(time), ctypes.c_double(size), 1)

    def reached(self) -> float:
        time = ctypes.c_double()
        self.call("GetRealStatus", 2, ctypes.byref(time))
        return time.value

    def size(self, name: str) -> int:
        return len(self.references(name))

    def type(self, kind: str) -> Any:
        return ctypes.c_int32 if kind == "Boolean" else _TYPES[kind]

    def _counted(self, kind: str, values: Sequence[Any]) -> tuple[Any, ...]:
        return ()

    def set_derivatives(self, name: str, values: Any, order: int = 1) -> int:
        """Time derivatives of an input in 1/s, for the next step."""
        given = np.ravel(values).tolist()
        orders = (ctypes.c_int32 * len(given))(*[order] * len(given))
        return self.call(
            "SetRealInputDerivatives", *_vr(self.references(name)), orders, (ctypes.c_double * len(given))(*given)
        )


class Fmi3Driver(Driver):
    """FMI 3.0.2."""

    fmi = 3
    kinds: ClassVar[dict[type, str]] = {float: "Float64", int: "Int32", str: "String"}
    state_calls = (
        "GetFMUState",
        "SetFMUState",
        "FreeFMUState",
        "SerializedFMUStateSize",
        "SerializeFMUState",
        "DeserializeFMUState",
    )

    def __init__(
        self,
        path: Any,
        instance: str = "driven",
        logging: bool = True,
        update: Callable[["Fmi3Driver", float], None] | None = None,
    ) -> None:
        """Of every intermediate update `update` is told the time, if the FMU has such updates."""
        self._update = update
        #: Arguments of the intermediate updates so far.
        self.updates: list[tuple[float, bool, bool, bool, bool]] = []
        #: Time that the last step came to, and whether it told of an event, of an end, or of an early return.
        self.stepped: tuple[float, bool, bool, bool] = (0.0, False, False, False)
        super().__init__(path, instance, logging)

    def updated(self) -> list[int]:
        """The variables that may be set in an intermediate update (FMPy does not read the attribute)."""
        root = ElementTree.parse(Path(self.folder) / "modelDescription.xml").getroot()
        asked = root.iterfind("ModelVariables/*[@intermediateUpdate='true']")
        return [int(element.attrib["valueReference"]) for element in asked]

    def made(self, name: str, token: str, **rest: Any) -> int | None:
        """See Driver; `rest` may have the `location` of the resources, and whether `events` are used."""
        self._logger = fmi3LogMessageCallback(self._log)
        self._updater = fmi3IntermediateUpdateCallback(*[self._updated] if self._update else [])
        return self.instantiated(name, token, **rest)

    def instantiated(self, name: str, token: str, location: str | None = None, events: bool = False) -> int | None:
        """See `made`; with the callbacks as they are."""
        place = str(Path(self.folder) / "resources") + "/" if location is None else location
        function = self.function("InstantiateCoSimulation")
        function.restype = ctypes.c_void_p
        flags = [ctypes.c_bool(flag) for flag in (False, self.logging, events, False)]
        result: int | None = function(
            name.encode(), token.encode(), place.encode(), *flags, *_vr(self.updated() if self._update else []), None,
            self._logger, self._updater,
        )  # fmt: skip
        return result

    def _log(self, _environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode()))

    def _updated(
        self, _environment: Any, time: float, sets: bool, gets: bool, done: bool, early: bool, returns: Any, _at: Any
    ) -> None:
        returns[0] = False
        self.updates.append((time, sets, gets, done, early))
        assert self._update is not None
        self._update(self, time)

    def setup(self, start: float = 0.0, stop: float = math.inf) -> int:
        """Kept for fmi3EnterInitializationMode, which has the times of the experiment."""
        self._times = start, stop
        return OK

    def enter(self) -> int:
        start, stop = self._times
        ends = ctypes.c_bool(stop < math.inf), ctypes.c_double(stop if stop < math.inf else 0.0)
        tolerance = ctypes.c_bool(False), ctypes.c_double(0.0)
        return self.call("EnterInitializationMode", *tolerance, ctypes.c_double(start), *ends)

    def advance(self, time: float, size: float) -> int:
        event, end, early, reached = ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double()
        told = [ctypes.byref(item) for item in (event, end, early, reached)]
        status = self.call("DoStep", ctypes.c_double(time), ctypes.c_double(size), ctypes.c_bool(True), *told)
        self.stepped = reached.value, event.value, end.value, early.value
        return status

    def reached(self) -> float:
        return self.get("time")[0]

    def size(self, name: str) -> int:
        return math.prod(self.variables[name].shape)

    def _counted(self, kind: str, values: Sequence[Any]) -> tuple[Any, ...]:
        return () if kind == "Clock" else (_Size(len(values)),)

    def adjoint(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Any) -> list[float]:
        """Gradients by `knowns` of `unknowns` weighted with `seed`."""
        return self._derivative("GetAdjointDerivative", unknowns, knowns, seed, knowns)


_DRIVERS: dict[str, Any] = {"2": Fmi2Driver, "3": Fmi3Driver}


def _vr(references: Sequence[int]) -> Iterator[Any]:
    """Value references as arguments: the array, and how many they are."""
    yield (ctypes.c_uint32 * len(references))(*references)
    yield _Size(len(references))
