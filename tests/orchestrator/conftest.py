"""Participants of one line of arithmetic, the command called in this process, and where tests build their FMUs."""

import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.connections import connect
from cardiac_cosim.orchestrator.coupling.master import Master
from cardiac_cosim.orchestrator.coupling.schemes import SCHEMES
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.participant import (
    Abilities,
    Implementation,
    Port,
    Ports,
    Ramp,
    Values,
    Wait,
)
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import Scenario

#: From the inputs, the outputs, begin and size of a step in s to the outputs at its end.
Law = Callable[..., Mapping[str, Any]]


def scalar(name: str, **rest: Any) -> Port:
    """A port of one number."""
    return Port(name, rest.pop("unit", "1"), rest.pop("shape", ()), record=rest.pop("record", "value"), **rest)


@dataclass
class Fake:
    """A participant that keeps a diary of all calls in `calls`."""

    name: str
    inputs: Any = ()
    outputs: Any = ()
    law: Law = lambda inputs, outputs, time, size: outputs
    begins: Mapping[str, Any] = field(default_factory=dict)
    calls: list[tuple[Any, ...]] = field(default_factory=list)
    #: The law gets the inputs at the step's begin as well.
    ramps: bool = False
    memoryless: bool = False
    #: From the inputs, the outputs in initialization mode; they stay as they begin if not given.
    initially: Law | None = None

    def __post_init__(self) -> None:
        self.inputs = Ports({port.name: port for port in self.inputs})
        self.outputs = Ports({port.name: port for port in self.outputs})
        self.observed = Ports()
        self._in: dict[str, Values] = {name: np.zeros(port.shape) for name, port in self.inputs.items()}
        self._out: dict[str, Values] = {name: np.zeros(port.shape) for name, port in self.outputs.items()}
        self._ramps: dict[str, Ramp] = {}
        self._initialising = False
        self._take(self.begins)

    def _take(self, values: Mapping[str, Any]) -> None:
        for name, value in values.items():
            given = np.asarray(value, float if self.outputs[name].is_real else None)
            self._out[name] = np.broadcast_to(given, self.outputs[name].shape)

    def begin(self) -> None:
        self.calls.append((self.name, "begin"))
        self._initialising = True

    def complete(self) -> None:
        self.calls.append((self.name, "complete"))
        self._follow()
        self._initialising = False

    def set(self, name: str, values: Values) -> None:
        if name not in self.inputs:
            name, values = self.inputs.with_element(name, values, self._in.__getitem__)
        if values.shape != self.inputs[name].shape:
            raise ParticipantError(f"{name} got the shape {values.shape}")
        self.calls.append((self.name, "set", name, values.tolist()))
        self._in[name] = values

    def _follow(self) -> None:
        if self._initialising and self.initially is not None:
            self._take(self.initially(self._in))

    def get(self, name: str) -> Values:
        self._follow()
        if name not in self._out:
            return self.outputs.element(name, self._out.__getitem__)
        return self._out[name].copy()

    def ramp(self, name: str, ramp: Ramp) -> None:
        self.calls.append((self.name, "ramp", name, ramp.begin.tolist(), ramp.end.tolist()))
        self._ramps[name] = ramp
        self._in[name] = ramp.end

    def start(self, time: float, size: float) -> Wait:
        self.calls.append((self.name, "step", time, size))
        ramps, self._ramps = self._ramps, {}
        begins = [self._in | {name: ramp.begin for name, ramp in ramps.items()}] if self.ramps else []
        self._take(self.law(self._in, self._out, time, size, *begins))
        return lambda: None

    def implementation(self) -> Implementation:
        return Implementation()

    @property
    def abilities(self) -> Abilities:
        return Abilities(ramps=self.ramps, memoryless=self.memoryless)

    def save(self) -> Any:
        self.calls.append((self.name, "save"))
        return dict(self._in), dict(self._out)

    def restore(self, state: Any) -> None:
        self.calls.append((self.name, "restore"))
        self._in, self._out = dict(state[0]), dict(state[1])

    def free(self, state: Any) -> None:
        self.calls.append((self.name, "free"))

    def pack(self) -> bytes:
        return pickle.dumps((self._in, self._out))

    def unpack(self, data: bytes) -> None:
        self._in, self._out = pickle.loads(data)

    def log_to(self, path: Path) -> None:
        pass

    def close(self) -> None:
        self.calls.append((self.name, "close"))


@pytest.fixture(scope="session")
def fake() -> type[Fake]:
    return Fake


def couple(units: Mapping[str, Any], steps: int = 1, written: Sequence[str] = (), **rest: Any) -> Master:
    """A master of `units` for so many steps; `rest` are its other parameters."""
    scheme, step_ms = rest.pop("scheme", "gauss-seidel"), rest.pop("step_ms", 1.0)
    connections = connect(units, written)
    scheme = SCHEMES[scheme]() if isinstance(scheme, str) else scheme
    timeline = Timeline.of_fixed_step(step_ms, steps * step_ms, rest.pop("every_ms", step_ms))
    return Master(units, connections, scheme, timeline, **rest)


@pytest.fixture(scope="session")
def master() -> Callable[..., Master]:
    return couple


@pytest.fixture(scope="session")
def port() -> Callable[..., Port]:
    return scalar


@pytest.fixture(scope="session")
def fmu_dir(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the FMUs of a test session are built, once for all tests."""
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture
def stopped(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Run a scenario that fails as soon as it has taken so many steps."""

    def run(steps: int, scenario: Scenario, base: Path, out: Path) -> None:
        step, taken = Master._take_step, []

        def fails(master: Master) -> Any:
            if len(taken) == steps:
                raise RunError("stopped")
            taken.append(1)
            return step(master)

        with monkeypatch.context() as patch:
            patch.setattr(Master, "_take_step", fails)
            with pytest.raises(RunError, match="stopped"):
                run_scenario(scenario, base, out)

    return run
