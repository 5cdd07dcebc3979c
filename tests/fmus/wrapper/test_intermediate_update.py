"""If these fail, inputs at the end of a step do not arrive, or a host that does more than that ends in a crash."""

from collections.abc import Callable
from typing import Any

import pytest

Run = Callable[..., Any]

_UPDATE = "update 0.75 set=1 get=0 finished=0 early=0"
_STEPPED = "step 0 time 0.75 events=0 end=0 early=0"


def test_values_at_the_end_go_to_the_slave_between_its_preparation_and_its_step(run: Run) -> None:
    done = run(3, "new", "start:0.5:", "on_update:set:Float64:2,1:7,8", "step:0.5:0.25", "free")
    # The early return that the host asks for was not offered.
    assert done.lines[2:] == [_UPDATE, "set 0", _STEPPED]
    assert done.calls[2:] == ["prepare_step 0.5 0.25", "set_at_end [2, 1] [7.0, 8.0]", "do_step 0.5 0.25"]


def test_a_host_that_announces_nothing_is_not_asked(run: Run) -> None:
    done = run(3, "announce:0", "new", "start:0.5:", "step:0.5:0.25", "free")
    assert done.lines[2:] == [_STEPPED]
    assert done.calls[2:] == ["do_step 0.5 0.25"]


def test_for_a_step_that_is_not_allowed_it_is_not_asked(run: Run) -> None:
    done = run(3, "new", "start:0.5:", "step:0.5:-1", "free")
    assert done.lines[2:] == ["log 3 invalidInput env: no step backwards", "step 3 time 0.5 events=0 end=0 early=0"]
    assert done.calls[2:] == ["prepare_step 0.5 -1.0"]


def test_other_calls_are_refused_meanwhile(run: Run) -> None:
    values = ["get:Float64:1:1", "set:Int32:1:1", "sets:1:x", "gets:1", "forward", "adjoint"]
    life = ["start:0:", "exit", "step:0.5:0.1", "reset", "end", "save", "drop"]
    words = [*values, *life, "call:fmi3GetBinary", "call:fmi3EnterEventMode"]
    done = run(3, "new", "start:0.5:", "garbage", f"on_update:{'+'.join(words)}", "step:0.5:0.25", "free")
    statuses = [
        line.split()[1] for line in done.lines[3:-1] if line.split()[:2] != ["log", "3"] and line[:5] != "there"
    ]
    assert statuses == ["3"] * len(words)
    # The step itself goes on: nothing was changed.
    assert done.lines[-1] == _STEPPED
    assert done.calls[2:] == ["prepare_step 0.5 0.25", "do_step 0.5 0.25"]


def test_what_changes_nothing_is_allowed_meanwhile(run: Run) -> None:
    done = run(3, "new", "start:0.5:", "on_update:version+log:off+log:on", "step:0.5:0.25", "free")
    assert done.lines[2:] == [_UPDATE, "version 3.0", "log 0", "log 0", _STEPPED]


def test_an_instance_outlives_its_step(run: Run) -> None:
    done = run(3, "new", "start:0.5:", "on_update:free:refused", "step:0.5:0.25", "reset", "free")
    assert "only fmi3SetFloat64 is allowed" in done.lines[3]
    assert done.lines[4:] == [_STEPPED, "reset 0"]


@pytest.mark.parametrize(
    ("reference", "reason"),
    [(3, "is none of the requiredIntermediateVariables"), (98, "the slave has a defect")],
)
def test_a_step_is_not_taken_with_a_value_that_was_refused(run: Run, reference: int, reason: str) -> None:
    words = ["announce:3", "new", "start:0.5:", f"on_update:set:Float64:{reference}:7", "step:0.5:0.25"]
    done = run(3, *words, "on_update:", "step:0.5:0.25", "free")
    assert reason in done.lines[3]
    assert done.lines[4] == "set 3"
    assert "the step is not taken: an intermediate value was refused" in done.lines[5]
    assert done.lines[6] == "step 3 time 0.5 events=0 end=0 early=0"
    # Nothing is left of it afterwards.
    assert done.lines[7:] == [_UPDATE, _STEPPED]
