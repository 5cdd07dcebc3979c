"""If these fail, a unit silently runs on another's numbers, or on none."""

from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.coupling.connections import Connection, End, connect
from cardiac_cosim.orchestrator.coupling.exchange import Inputs
from cardiac_cosim.orchestrator.coupling.loops import groups_in_order
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants.native import Mesh, NativeParticipant
from cardiac_cosim.orchestrator.participants.participant import Ramp


def _texts(connections: tuple[Connection, ...]) -> set[str]:
    return {str(connection) for connection in connections}


def _links(*pairs: str) -> list[Connection]:
    return [Connection(End(pair[0], "y"), End(pair[1], "u")) for pair in pairs]


def test_the_units_of_the_heart_find_each_other_by_name(small_heart: Mesh) -> None:
    units = {
        "fibers": "fiber_generator",
        "electrophysiology": "electrophysiology",
        "active_stress": "active_stress",
        "mechanics": "mechanics",
    }
    heart = {name: NativeParticipant(name, unit, small_heart, {}) for name, unit in units.items()}
    assert _texts(connect(heart, [])) == {
        "fibers.fiber -> electrophysiology.fiber",
        "fibers.fiber -> mechanics.fiber",
        "fibers.sheet -> mechanics.sheet",
        "mechanics.stretch -> electrophysiology.stretch",
        "electrophysiology.potential -> active_stress.potential",
        "active_stress.active_stress -> mechanics.active_stress",
    }
    # With length dependence the active stress follows the stretch too, and an algebraic loop comes into being.
    heart["active_stress"] = NativeParticipant("active_stress", "active_stress", small_heart, {"length_dependence": 1})
    looped = _texts(connect(heart, []))
    assert "mechanics.stretch -> active_stress.stretch" in looped
    # And the mechanics is told of it, if it wants to know.
    stabilising = {f"active_stress.{name} -> mechanics.{name}" for name in ("active_stiffness", "reference_stretch")}
    assert stabilising < looped
    heart["mechanics"] = NativeParticipant("mechanics", "mechanics", small_heart, {"stabilization": 0})
    assert _texts(connect(heart, [])) == looped - stabilising


def test_a_written_connection_goes_before_the_one_by_name(fake, port) -> None:
    units = {
        "a": fake("a", outputs=[port("x"), port("other")]),
        "b": fake("b", inputs=[port("x"), port("free")]),
    }
    assert _texts(connect(units, [])) == {"a.x -> b.x"}
    assert _texts(connect(units, ["a.other -> b.x"])) == {"a.other -> b.x"}
    assert _texts(connect(units, ["  a.other->b.free "])) == {"a.other -> b.free", "a.x -> b.x"}


def test_an_output_may_feed_many_inputs_and_a_unit_itself(fake, port) -> None:
    units = {
        "a": fake("a", [port("u")], [port("x")]),
        "b": fake("b", [port("x")]),
        "c": fake("c", [port("x")]),
    }
    assert _texts(connect(units, ["a.x -> a.u"])) == {"a.x -> a.u", "a.x -> b.x", "a.x -> c.x"}


def test_names_as_foreign_fmus_have_them_can_be_written(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("arm.joint.phi")]), "b": fake("b", [port("der(x)")])}
    assert _texts(connect(units, ["a.arm.joint.phi -> b.der(x)"])) == {"a.arm.joint.phi -> b.der(x)"}


def test_an_input_that_does_not_matter_is_left_alone_unless_written(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x")]), "b": fake("b", [port("x", live=False)])}
    assert connect(units, []) == ()
    assert _texts(connect(units, ["a.x -> b.x"])) == {"a.x -> b.x"}


def test_an_output_that_says_nothing_feeds_nobody_unless_written(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x", live=False)]), "b": fake("b", [port("x")])}
    assert connect(units, []) == ()
    assert _texts(connect(units, ["a.x -> b.x"])) == {"a.x -> b.x"}
    # Nor does it compete with one that does.
    units["c"] = fake("c", outputs=[port("x")])
    assert _texts(connect(units, [])) == {"c.x -> b.x"}


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (["a.x"], ["'a.x' cannot be read", "unit.output -> unit.input"]),
        (["a.x => b.u"], ["'a.x => b.u' cannot be read", "unit.output -> unit.input"]),
        (["a.x <- b.u"], ["cannot be read"]),
        (["a -> b"], ["'a -> b' cannot be read"]),
        ([""], ["cannot be read"]),
        (["a.x -> b.u -> a.u"], ["cannot be read"]),
        (["alpa.x -> b.u"], ["unknown unit 'alpa'", "did you mean 'alpha'?"]),
        (["alpha.potental -> b.u"], ["unit 'alpha' has no output 'potental'", "did you mean 'potential'?"]),
        (["alpha.potential -> b.zzzzz"], ["unit 'b' has no input 'zzzzz'", "(known: p, u"]),
        (["b.u -> alpha.potential"], ["unit 'b' has no output 'u'", "(known: none)"]),
        (
            ["alpha.potential -> b.u", "alpha.field -> b.u"],
            ["the input b.u has more than one source", "keep one of them"],
        ),
        (["alpha.potential -> b.p", "alpha.potential -> b.p"], ["the input b.p has more than one source"]),
        (["alpha.field -> b.u"], ["'alpha.field -> b.u'", "shapes differ, (3,) -> ()", "same mesh"]),
        (["alpha.field -> b.v"], ["shapes differ, (3,) -> (3, 1)"]),
        (
            ["alpha.potential -> b.p"],
            [
                "'alpha.potential -> b.p'",
                "units of measure differ, mV -> V",
                "write the conversion, 'alpha.potential * <factor> -> b.p'",
            ],
        ),
        (["alpha.potential * -> b.p"], ["cannot be read", "unit.output * 0.001 + 273 -> unit.input"]),
        (["alpha.potential * 1e -> b.p"], ["cannot be read"]),
        (["alpha.potential + 1 * 2 -> b.p"], ["cannot be read"]),
    ],
)
def test_a_wrong_connection_is_named_with_its_remedy(fake, port, written: list[str], words: list[str]) -> None:
    units = {
        "alpha": fake("alpha", outputs=[port("potential", unit="mV"), port("field", shape=(3,))]),
        "b": fake("b", [port("u", unit=None), port("v", shape=(3, 1)), port("p", unit="V")]),
    }
    with pytest.raises(InputError) as caught:
        connect(units, written)
    message = str(caught.value)
    assert message.startswith("connections: ")
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_unit_of_measure_that_is_not_declared_fits_all(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x", unit="mV")]), "b": fake("b", [port("x", unit=None)])}
    assert _texts(connect(units, [])) == {"a.x -> b.x"}


@pytest.mark.parametrize(
    ("written", "factor", "offset"),
    [
        ("* 0.001", 0.001, 0.0),
        ("* -2.5e-3 + 273.15", -2.5e-3, 273.15),
        ("* 2 - 1", 2.0, -1.0),
        ("- 1", 1.0, -1.0),
        ("* 1 + -.5", 1.0, -0.5),
        # That nothing is to be done about units that differ can be said as well.
        ("* 1", 1.0, 0.0),
    ],
)
def test_a_law_on_the_way(fake, port, written: str, factor: float, offset: float) -> None:
    units = {"a": fake("a", outputs=[port("x", unit="mV")]), "b": fake("b", [port("u", unit="V")])}
    (link,) = connect(units, [f"a.x {written} -> b.u"])
    values = np.array([1.0, -3.0])
    np.testing.assert_array_equal(link.carried(values), factor * values + offset)
    ramp = link.ramped(Ramp(values, 2.0 * values, 3.0 * values))
    np.testing.assert_array_equal(ramp.end, factor * 2.0 * values + offset)
    np.testing.assert_array_equal(ramp.curvature, factor * 3.0 * values)
    # What is printed can be written.
    assert connect(units, [str(link)]) == (link,)


def test_names_of_foreign_variables_are_no_laws(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x*2+1"), port("y-1")]), "b": fake("b", [port("u"), port("v")])}
    links = connect(units, ["a.x*2+1 -> b.u", "a.y-1 -> b.v"])
    assert _texts(links) == {"a.x*2+1 -> b.u", "a.y-1 -> b.v"}
    assert all(link.law is None for link in links)


@pytest.mark.parametrize("ramps", [False, True])
def test_a_law_is_applied_to_every_value_that_is_exchanged(fake, port, master, ramps: bool) -> None:
    def counting(inputs: Any, outputs: Any, time: float, size: float) -> dict[str, Any]:
        return {"x": outputs["x"] + 1.0}

    units = {
        "a": fake("a", outputs=[port("x")], begins={"x": 1.0}, law=counting),
        "b": fake("b", [port("u")], law=lambda *_: {}, ramps=ramps),
    }
    master(units, 2, ["a.x * 10 + 5 -> b.u"], inputs=Inputs(linear=ramps)).run([])
    given = [call[3:] for call in units["b"].calls if call[1] in ("set", "ramp")]
    assert given == [(15.0,), *([(15.0, 25.0), (25.0, 35.0)] if ramps else [(25.0,), (35.0,)])]


def test_nothing_is_connected_by_name_if_that_is_not_wanted(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x"), port("y")]), "b": fake("b", [port("x"), port("y")])}
    assert _texts(connect(units, ["a.y -> b.x"], by_name=False)) == {"a.y -> b.x"}
    assert _texts(connect(units, ["a.y -> b.x"])) == {"a.y -> b.x", "a.y -> b.y"}


def test_connections_by_name_are_checked_like_written_ones(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x", shape=(4,))]), "b": fake("b", [port("x", shape=(5,))])}
    with pytest.raises(InputError, match=r"'a\.x -> b\.x': the shapes differ, \(4,\) -> \(5,\)"):
        connect(units, [])


def test_two_outputs_of_one_name_leave_the_choice_to_the_person(fake, port) -> None:
    units = {"a": fake("a", outputs=[port("x")]), "b": fake("b", outputs=[port("x")]), "c": fake("c", [port("x")])}
    with pytest.raises(InputError, match=r"several outputs are named x; write 'a\.x -> c\.x' or 'b\.x -> c\.x'"):
        connect(units, [])
    assert _texts(connect(units, ["b.x -> c.x"])) == {"b.x -> c.x"}


@pytest.mark.parametrize(
    ("units", "links", "order"),
    [
        ("abc", [], "abc"),
        ("abc", ["ca", "ab"], "cab"),
        ("dcba", ["ab", "bc", "cd"], "abcd"),
        # A loop keeps the given order inside, and its place among the others by what feeds it.
        ("abc", ["ab", "bc", "ca"], "abc"),
        ("bacd", ["ab", "ba", "ca", "bd"], "cbad"),
        ("ab", ["aa", "ba"], "ba"),
    ],
)
def test_units_are_initialised_after_those_that_feed_them(units: str, links: list[str], order: str) -> None:
    groups = groups_in_order(units, _links(*links))
    assert [unit for group in groups for unit in group.units] == list(order)
