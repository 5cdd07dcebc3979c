"""A master that knows FMI only: FMPy, the model description, and nothing of this project. Also run on its own."""

import shutil
import tempfile
from collections.abc import Sequence
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    free,
)

DISCARD = 2
ERROR = 3

#: What a host that does not look at the status has of a call that failed.
_NOTHING = {"getReal": float("nan"), "getInteger": -(2**31), "getBoolean": False, "getString": ""}


class _Lenient:
    """FMPy's FMU2Slave, whose failing calls are noted in `refused` instead of raised."""

    def __init__(self, fmu: FMU2Slave, refused: list[tuple[str, int]]) -> None:
        self._fmu = fmu
        self._refused = refused

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._fmu, name)
        if not callable(attribute) or name == "doStep":
            return attribute

        def call(*arguments: Any, **named: Any) -> Any:
            try:
                return attribute(*arguments, **named)
            except FMICallException as error:
                self._refused.append((name, error.status))
                return [_NOTHING[name]] * len(arguments[0]) if name in _NOTHING else None

        return call


class Driver:
    """One instance of one FMU, driven with FMPy's plain lists; a field is all scalars of one name, as declared."""

    def __init__(self, path: Any, instance: str = "driven") -> None:
        self.description = read_model_description(str(path), validate=False)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.fields: dict[str, list[int]] = {}
        for variable in self.description.modelVariables:
            self.fields.setdefault(variable.name.split("[")[0], []).append(variable.valueReference)
        #: (status, category, text) of every message, in order; a doubled percent sign of the printf format is undone.
        self.messages: list[tuple[int, str, str]] = []
        #: (call, status) of every call but a step that came back with another status than OK or Warning.
        self.refused: list[tuple[str, int]] = []
        self.has_own_wrapper = "PythonFMU" not in (self.description.generationTool or "")
        #: The status of a step that is refused because an earlier call failed.
        self.given_up = ERROR if self.has_own_wrapper else DISCARD
        self.folder = str(extract(str(path), tempfile.mkdtemp(prefix="driver-")))
        self._callbacks = fmi2CallbackFunctions()
        self._callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        self._callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self._callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self._instance = instance
        self.instantiate()

    def _log(self, _environment: Any, _instance: bytes, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, (category or b"").decode(), message.decode().replace("%%", "%")))

    def instantiate(self) -> None:
        fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=self._instance,
        )
        fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        if not self.has_own_wrapper:
            # A flaw: it otherwise frees this object twice at the end of the process.
            fmu.dll.finalizePythonInterpreter()
        self.fmu: Any = _Lenient(fmu, self.refused)

    def free(self) -> None:
        self.fmu.freeInstance()

    def close(self) -> None:
        self.free()
        shutil.rmtree(self.folder)

    def errors(self) -> str:
        """The texts of all errors since the last time this was asked."""
        texts = [text for status, _, text in self.messages if status >= ERROR]
        self.messages.clear()
        return "\n".join(texts)

    def parameterize(self, parameters: dict[str, Any]) -> None:
        for name, value in parameters.items():
            variable = self.variables[name]
            getattr(self.fmu, f"set{variable.type}")([variable.valueReference], [value])

    def start(self, parameters: dict[str, Any], inputs: dict[str, Sequence[float]]) -> None:
        """From instantiated to the first step."""
        self.parameterize(parameters)
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        for name, values in inputs.items():
            self.set(name, values)
        self.fmu.exitInitializationMode()

    def set(self, name: str, values: Sequence[float]) -> None:
        self.fmu.setReal(self.fields[name], np.ravel(values).tolist())

    def get(self, name: str) -> list[float]:
        return self.fmu.getReal(self.fields[name])

    def outputs(self) -> dict[str, list[float]]:
        names = {v.name.split("[")[0]: None for v in self.description.modelVariables if v.causality == "output"}
        return {name: self.get(name) for name in names}

    def step(self, time: float, size: float, inputs: dict[str, Sequence[float]] | None = None) -> int:
        """The status of fmi2DoStep."""
        for name, values in (inputs or {}).items():
            self.set(name, values)
        try:
            self.fmu.doStep(time, size)
        except FMICallException as error:
            return error.status
        return 0
