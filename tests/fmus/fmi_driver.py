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
        self.fmu = FMU2Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=self._instance,
        )
        self.fmu.instantiate(callbacks=self._callbacks, loggingOn=True)
        # Against a flaw of PythonFMU's wrapper, which otherwise frees this object twice at the end of the process.
        self.fmu.dll.finalizePythonInterpreter()

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
