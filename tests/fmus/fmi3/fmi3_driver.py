"""A master that knows FMI 3.0 only: FMPy, the model description, and nothing of this project. Also run on its own."""

import shutil
import tempfile
from math import prod
from typing import Any

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

DISCARD = 2
ERROR = 3


class Driver:
    """One instance of one FMU; a field is one variable."""

    def __init__(self, path: Any, instance: str = "driven") -> None:
        self.description = read_model_description(str(path), validate=False)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        #: (status, category, text) of every message, in order.
        self.messages: list[tuple[int, str, str]] = []
        self.folder = str(extract(str(path), tempfile.mkdtemp(prefix="driver-")))
        self._instance = instance
        self.instantiate()

    def _log(self, _environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.messages.append((status, category.decode(), message.decode()))

    def instantiate(self) -> None:
        self.fmu = FMU3Slave(
            guid=self.description.guid,
            unzipDirectory=self.folder,
            modelIdentifier=self.description.coSimulation.modelIdentifier,
            instanceName=self._instance,
        )
        self.fmu.instantiate(loggingOn=True, logMessage=self._log)

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

    def start(self, parameters: dict[str, Any], inputs: dict[str, np.ndarray]) -> None:
        """From instantiated to the first step."""
        self.parameterize(parameters)
        self.fmu.enterInitializationMode(startTime=0.0)
        for name, values in inputs.items():
            self.set(name, values)
        self.fmu.exitInitializationMode()

    def set(self, name: str, values: Any) -> None:
        self.fmu.setFloat64([self.variables[name].valueReference], np.ravel(values).tolist())

    def get(self, *names: str) -> list[float]:
        """The values of the variables, one after the other."""
        variables = [self.variables[name] for name in names]
        return self.fmu.getFloat64([v.valueReference for v in variables], sum(prod(v.shape) for v in variables))

    def outputs(self) -> dict[str, list[float]]:
        return {name: self.get(name) for name, variable in self.variables.items() if variable.causality == "output"}

    def step(self, time: float, size: float, inputs: dict[str, np.ndarray] | None = None) -> int:
        """The status of fmi3DoStep."""
        for name, values in (inputs or {}).items():
            self.set(name, values)
        try:
            self.fmu.doStep(time, size)
        except FMICallException as error:
            return error.status
        return 0
