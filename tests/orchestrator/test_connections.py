"""If these fail, a unit silently runs on another's numbers, or on none."""

import pytest
from cardiac_cosim.orchestrator.coupling.connections import Connection, End, connect, initial_order
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants.native import Mesh, NativeParticipant


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
    assert "mechanics.stretch -> active_stress.stretch" in _texts(connect(heart, []))


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
        (["alpha.potential -> b.p"], ["'alpha.potential -> b.p'", "units of measure differ, mV -> V", "no conversion"]),
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
    assert initial_order(units, _links(*links)) == list(order)
