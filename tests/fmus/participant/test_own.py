"""If these fail, a unit is another participant as an FMU than by direct calls, or its words do not reach a person."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.native import NativeParticipant
from cardiac_cosim.orchestrator.participants.participant import Ramp
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS

Join = Callable[..., FmuParticipant]


def _pair(case: Any, packed: dict, join: Join) -> tuple[NativeParticipant, FmuParticipant]:
    """The unit by direct calls and as an FMU, both initialised."""
    native = NativeParticipant(case.unit, case.unit, case.mesh, case.parameters)
    fmu = join(packed[case.unit], case.unit, **case.parameters)
    for participant in (native, fmu):
        participant.begin()
        for name, values in case.first().items():
            participant.set(name, values)
        participant.complete()
    return native, fmu


def _same(native: NativeParticipant, fmu: FmuParticipant) -> None:
    for name, port in fmu.outputs.items():
        values = fmu.get(name)
        assert values.shape == port.shape
        np.testing.assert_array_equal(values, native.get(name), err_msg=name)


def test_ports_abilities_and_values_are_those_of_the_native_participant(case: Any, packed: dict, join: Join) -> None:
    native, fmu = _pair(case, packed, join)
    assert fmu.inputs == native.inputs
    assert fmu.outputs == native.outputs
    assert fmu.abilities == native.abilities
    _same(native, fmu)
    for step, inputs in zip(case.steps, case.inputs, strict=True):
        for participant in (native, fmu):
            for name, values in inputs.items():
                participant.set(name, values)
            participant.start(*step)
        _same(native, fmu)


@pytest.mark.parametrize("unit", [name for name, unit in UNITS.items() if unit.interpolates])
def test_inputs_that_ramp_are_those_of_the_native_participant(unit: str, cases: dict, packed: dict, join: Join) -> None:
    """By derivatives, by intermediate updates, and by direct calls: one straight line, to the last bit."""
    case = cases[unit]
    native, fmu = _pair(case, packed, join)
    ramped = False
    for number, (time, size) in enumerate(case.steps):
        last = case.inputs[(number + 1) % 4]
        for participant in (native, fmu):
            for name, begin in case.inputs[number].items():
                # One of the inputs is held in every other step.
                if number % 2 and name == min(last):
                    participant.set(name, begin)
                else:
                    participant.ramp(name, Ramp(begin, last[name]))
            participant.start(time, size)
        _same(native, fmu)
        for name in case.inputs[number]:
            if name in fmu.observed:
                np.testing.assert_array_equal(fmu.get(name), native.get(name))
        ramped |= any(not np.array_equal(fmu.get(name), case.expected[number + 1][name]) for name in fmu.outputs)
    assert ramped


def test_states_go_back_and_into_another_instance(cases: dict, packed: dict, join: Join) -> None:
    case = cases["electrophysiology"]
    _, one = _pair(case, packed, join)
    _, other = _pair(case, packed, join)
    one.start(*case.steps[0])
    saved, stored = one.save(), one.pack()
    one.start(1e-3, 1e-3)
    after = one.get("potential")
    one.restore(saved)
    assert (one.get("potential") != after).any()
    other.unpack(stored)
    for participant in (one, other):
        participant.start(1e-3, 1e-3)
        np.testing.assert_array_equal(participant.get("potential"), after)
    one.free(saved)
    with pytest.raises(ParticipantError, match="these bytes are not a state"):
        other.unpack(stored[:100])


def test_an_input_that_does_not_matter_is_not_live(packed: dict, join: Join) -> None:
    assert not join(packed["active_stress"]).inputs["stretch"].live
    assert join(packed["active_stress"], length_dependence=0.5).inputs["stretch"].live


def test_what_get_returns_is_the_callers(packed: dict, cases: dict, ready: Join) -> None:
    participant = ready(packed["active_stress"])
    first = participant.get("active_stress")
    participant.set("potential", cases["active_stress"].inputs[0]["potential"])
    participant.start(0.0, 1e-3)
    second = participant.get("active_stress")
    assert not first.any()
    assert second.any()


def test_a_failing_step_says_why(packed: dict, tiny: Mesh, ready: Join) -> None:
    participant = ready(packed["active_stress"], delay_function="as_printed")
    participant.set("potential", np.full(tiny.nodes, 20.0))
    for _ in range(2):
        with pytest.raises(ParticipantError, match=r"at node 0 \(potential 20.0 mV\).*use delay_function: gompertz$"):
            participant.start(0.0, 1e-3)


@pytest.mark.parametrize("unit", ["mechanics", "fiber_generator"])
def test_a_mesh_without_boundaries_is_the_persons_error(
    unit: str, fmi: int, tiny: Mesh, cases: dict, tmp_path: Path, join: Join
) -> None:
    bare = Mesh(tiny.points, tiny.cells, {"lid": tiny.boundary("base")})
    participant = join(build_fmu(UNITS[unit], bare, tmp_path / "bare.fmu", fmi), "pump")
    participant.begin()
    for name, values in cases[unit].first().items():
        participant.set(name, values)
    with pytest.raises(InputError, match=r"^unit 'pump': the mesh has no boundary named '\w+' \(it has: lid\)"):
        participant.complete()


def test_no_state_to_start_from_is_not_the_persons_error(packed: dict, cases: dict, join: Join) -> None:
    participant = join(packed["mechanics"], neo_hooke_log_sign="as_printed")
    participant.begin()
    for name, values in cases["mechanics"].first().items():
        participant.set(name, values)
    with pytest.raises(ParticipantError, match="no stress-free state to start from"):
        participant.complete()


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        (
            "delay_function",
            "100%",
            r"'delay_function' of type String cannot be '100%': .* is '100%'; choose one of: gom",
        ),
        ("slow_rate_per_ms", -1.0, r"'slow_rate_per_ms' of type \w+ cannot be -1.0: .*> 0"),
        ("length_dependence", "strong", r"'length_dependence' of type \w+ cannot be 'strong'"),
        ("slow_rate", 1.0, "has no parameter 'slow_rate'; did you mean 'slow_rate_per_ms'"),
        ("potential", 1.0, "has no parameter 'potential'"),
    ],
)
def test_wrong_parameters(name: str, value: Any, message: str, packed: dict, join: Join) -> None:
    with pytest.raises(InputError, match=f"^unit 'guest'.*{message}"):
        join(packed["active_stress"], **{name: value})


def test_a_field_of_the_wrong_shape_is_refused(packed: dict, tiny: Mesh, ready: Join) -> None:
    participant = ready(packed["active_stress"])
    # NumPy would spread the first two over all nodes.
    for values in (np.array(20.0), np.full(1, 20.0), np.full(tiny.nodes + 1, 20.0)):
        with pytest.raises(ParticipantError, match=r"'potential' of unit 'guest' got shape .*expected \(16,\)"):
            participant.set("potential", values)


def test_not_finite_is_refused(packed: dict, tiny: Mesh, ready: Join) -> None:
    participant = ready(packed["active_stress"])
    values = np.zeros(tiny.nodes)
    values[6] = np.nan
    with pytest.raises(ParticipantError, match=r"'potential' .* is not finite at node \[6\]"):
        participant.set("potential", values)


def test_messages_reach_the_participant_they_belong_to(packed: dict, tiny: Mesh, ready: Join) -> None:
    one = ready(packed["active_stress"], "one", delay_function="as_printed")
    other = ready(packed["active_stress"], "other", delay_function="as_printed")
    for participant, potential in ((one, 10.0), (other, 20.0)):
        participant.set("potential", np.full(tiny.nodes, potential))
    for _ in range(2):
        with pytest.raises(ParticipantError, match=r"10\.0 mV"):
            one.start(0.0, 1e-3)
        with pytest.raises(ParticipantError, match=r"20\.0 mV"):
            other.start(0.0, 1e-3)
    one.close()
    with pytest.raises(ParticipantError, match=r"20\.0 mV"):
        other.start(0.0, 1e-3)
