"""If these fail, the wrapper asks the slave for something else than the host asked for, or gives another answer."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]

_INTEGERS = [f"{sign}Int{bits}" for bits in (8, 16, 32, 64) for sign in ("", "U")]


def _size(kind: str) -> int:
    return int(kind.removeprefix("U").removeprefix("Int")) // 8


def _real(fmi: int) -> str:
    return "Real" if fmi == 2 else "Float64"


def test_a_life_from_beginning_to_end(run: Run, fmi: int, resources: Path) -> None:
    real = _real(fmi)
    words = ["version", "new", "start:0.5:2", f"set:{real}:1,2:1.5,2.5", "exit", f"get:{real}:1,2:2"]
    done = run(fmi, *words, "announce:0", "step:0.5:0.25", "reset", "end", "free")
    assert done.err == ""
    stepped = "step 0 time 0 0.75" if fmi == 2 else "step 0 time 0.75 events=0 end=0 early=0"
    update = [] if fmi == 2 else ["update 0.75 set=1 get=0 finished=0 early=0"]
    after = ["set 0", "exit 0", "get 0 1.5 2.5", *update, stepped, "reset 0", "end 0"]
    assert done.lines == [f"version {fmi}.0", "new 1", "start 0", *after]
    begin = ["setup_experiment 0.5 2.0", "enter_initialization_mode"]
    assert done.calls == [
        f"instantiate {resources.name} right {fmi}",
        *(begin if fmi == 2 else ["enter_initialization_mode 0.5 2.0"]),
        f"set_numbers {real} [1, 2] [1.5, 2.5]",
        "exit_initialization_mode",
        f"get_numbers {real} [1, 2] 16",
        *([] if fmi == 2 else ["prepare_step 0.5 0.25"]),
        "do_step 0.5 0.25",
        "reset",
        "terminate",
    ]


def test_a_stop_time_that_is_not_defined_is_infinite(run: Run, fmi: int) -> None:
    call = "setup_experiment 1.0 inf" if fmi == 2 else "enter_initialization_mode 1.0 inf"
    assert call in run(fmi, "new", "start:1:", "free").calls


@pytest.mark.parametrize("form", ["file://{}", "file:{}", "file://localhost{}", "{plain}", "{plain}/"])
def test_resources_are_found_in_every_form(run: Run, fmi: int, resources: Path, form: str) -> None:
    encoded = resources.as_uri().removeprefix("file://")
    assert run(fmi, "new", "free", location=form.format(encoded, plain=resources)).lines == ["new 1"]


@pytest.mark.parametrize(
    ("fmi", "kind", "values", "size"),
    [
        (2, "Integer", "-7,8", 4),
        (2, "Boolean", "0,1", 4),
        (3, "Boolean", "0,1", 1),
        (3, "Float32", "0.5,-0.25", 4),
        *((3, kind, "7,100" if kind.startswith("U") else "-7,100", _size(kind)) for kind in _INTEGERS),
    ],
)
def test_numbers_of_every_type_cross(run: Run, fmi: int, kind: str, values: str, size: int) -> None:
    done = run(fmi, "new", f"set:{kind}:3,4:{values}", f"get:{kind}:3,4:2", "free")
    assert done.lines == ["new 1", "set 0", "get 0 " + values.replace(",", " ")]
    assert done.calls[-1] == f"get_numbers {kind} [3, 4] {2 * size}"


def test_an_array_is_one_reference_and_many_values(run: Run) -> None:
    done = run(3, "new", "set:Float64:7:1,2,3,4", "get:Float64:7:4", "get:Float64::0", "free")
    assert done.lines[1:] == ["set 0", "get 0 1 2 3 4", "get 0"]
    assert done.calls[1] == "set_numbers Float64 [7] [1.0, 2.0, 3.0, 4.0]"


def test_texts_cross_in_utf_8(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "sets:1,2:Größe", "gets:1,2", "gets:3", "free", PYTHONUTF8="1")
    assert done.lines[1:] == ["sets 0", "gets 0 'Größe' 'Größe'", "gets 0 ''"]
    assert done.calls[1] == "set_strings [1, 2] ['Größe', 'Größe']"


def test_texts_that_are_none_are_refused(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "sets:1:NULL", "sets:1:\udcff", "gets:93", "gets:94", "free")
    statuses = [line for line in done.lines if not line.startswith("log")]
    assert statuses == ["new 1", "sets 3", "sets 3", "gets 3", "gets 3"]
    logged = [line for line in done.lines if line.startswith("log")]
    assert "a text to be set is NULL" in logged[0]
    assert "can't decode byte 0xff" in logged[1]
    assert "expected bytes, str found" in logged[2]
    # One reference, two texts: never more than there is room for.
    assert "another number of values than was asked for" in logged[3]
    assert len(logged) == 4


def test_derivatives_cross(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "forward", *(["rates"] if fmi == 2 else ["adjoint"]), "free")
    assert done.lines[1:] == ["derivative 0 3", *(["rates 0"] if fmi == 2 else ["derivative 0 4.5"])]
    last = "set_input_derivatives [1, 2] [1, 1] [0.5, -0.5]" if fmi == 2 else "get_adjoint_derivative [5] [6] [1.5]"
    assert done.calls[1:] == ["get_directional_derivative [5] [6] [1.5]", last]


@pytest.mark.parametrize("name", ["fmi3GetBinary", "fmi3SetBinary", "fmi3GetClock", "fmi3SetClock"])
def test_types_that_nothing_has_are_refused_by_the_slave(run: Run, name: str) -> None:
    done = run(3, "new", f"call:{name}", "free")
    kind = name[-6:] if name.endswith("Binary") else "Clock"
    assert done.lines[1:] == [f"log 3 invalidInput env: 'x' is of type Real, not {kind}", f"{name} 3"]
    assert done.calls[1:] == [f"refuse_type {kind} []"]


def test_a_status_is_the_slaves_own_and_its_reason_is_told(run: Run, fmi: int) -> None:
    real = _real(fmi)
    done = run(fmi, "new", *(f"set:{real}:{reference}:0" for reference in (95, 96, 97, 98, 99, 100, 101)), "free")
    me = "two" if fmi == 2 else "env"
    # A warning is no failure: the host of FMI 2 asked for no log, that of FMI 3 did.
    lines = [line for line in done.lines[1:] if line != "log 1 logStatusWarning env: 95 is odd"]
    assert len(lines) == len(done.lines) - fmi + 1
    assert lines == [
        "set 1",
        f"log 2 logStatusError {me}: not now",
        "set 2",
        f"log 3 logStatusError {me}: " + lines[3].partition(": ")[2],
        "set 3",
        f"log 3 logStatusError {me}: the slave has a defect",
        "set 3",
        # A number sign is doubled, as it marks value references; a percent sign arrives through printf.
        f"log 3 invalidInput {me}: 100% of ##99 is wrong",
        "set 3",
        f"log 3 logStatusError {me}: " + lines[9].partition(": ")[2],
        "set 3",
        "set 3",
    ]


def test_the_time_reached_is_the_slaves(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "announce:0", "start:0:", "step:0:0.5", "step:0.5:2", "free")
    steps = [line.partition(" time ") for line in done.lines if line.startswith("step")]
    assert [status for status, _, _ in steps] == ["step 0", "step 2"]
    assert [told.removeprefix("0 ").split()[0] for _, _, told in steps] == ["0.5", "0.5"]
    raised = run(fmi, "new", "start:0:", "step:0:nan", "free")
    # Of a step that is no number, FMI 3 asks before it asks for intermediate values.
    assert any("what a step" in line or "no step backwards" in line for line in raised.lines)
    assert "step 3 time" in raised.lines[-1]


def test_what_is_no_time_is_an_error(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "start:-5:", "step:-5:0.5", "free")
    assert "must be real number, not str" in done.lines[-2]
    assert done.lines[-1].startswith("step 0 time 3" if fmi == 2 else "step 3 time nan")


def test_a_wrong_token_and_missing_resources_are_told(run: Run, fmi: int, resources: Path) -> None:
    wrong = run(fmi, "new", token="another")
    assert wrong.lines[0].endswith(": the token another is not that of this FMU")
    assert wrong.lines[1] == "new 0"
    nowhere = run(fmi, "new", location=str(resources / "nowhere"))
    assert f"there is no file load.py in the resources of the FMU, {resources}/nowhere" in nowhere.lines[0]
    assert run(2, "new", location="file://host").lines[0].endswith("the location of the resources is no file: URI")


def test_without_python_it_says_what_it_looks_for(run: Run, fmi: int) -> None:
    done = run(fmi, "new", COSIM_PYTHON="/nowhere/python")
    assert "this FMU needs Python, and the command /nowhere/python does not run; set" in done.lines[0]
    assert done.lines[1] == "new 0"
    done = run(fmi, "new", COSIM_PYTHON="/bin/false")
    assert "the command /bin/false does not run" in done.lines[0]
    done = run(fmi, "new", COSIM_PYTHON="/bin/echo")
    assert "cannot be loaded" in done.lines[0]
    done = run(fmi, "new", "free", COSIM_PYTHON="", PATH=f"{Path(sys.executable).parent}:/bin")
    assert done.lines == ["new 1"]
