"""If these fail, an FMU state is lost, leaks, or is another one than was saved; or a wrong pointer ends the host."""

from collections.abc import Callable
from typing import Any

Run = Callable[..., Any]

_NO_STATE = "the pointer is no FMU state of this FMU, or it has been freed"


def _real(fmi: int) -> str:
    return "Real" if fmi == 2 else "Float64"


def test_what_was_saved_comes_back(run: Run, fmi: int) -> None:
    real = _real(fmi)
    one, two = f"set:{real}:1:1", f"set:{real}:1:2"
    done = run(fmi, "new", one, "save", two, "restore", f"get:{real}:1:1", "drop", "free")
    assert done.lines[1:] == ["set 0", "save 0", "set 0", "restore 0", "get 0 1", "drop 0"]


def test_a_state_that_is_given_is_overwritten_and_its_predecessor_let_go(run: Run, fmi: int) -> None:
    real = _real(fmi)
    alive = f"get:{real}:90:1"
    done = run(fmi, "new", alive, "save", alive, "save", "save", alive, "drop", alive, "free")
    assert [line for line in done.lines if line.startswith("get")] == ["get 0 1", "get 0 2", "get 0 2", "get 0 1"]


def test_a_state_is_written_and_read(run: Run, fmi: int) -> None:
    real = _real(fmi)
    words = ["new", f"set:{real}:1:1", "save", "pack", f"set:{real}:1:2", "drop", "unpack", "restore"]
    done = run(fmi, *words, f"get:{real}:1:1", "unpack", "unpack", f"get:{real}:90:1", "free")
    assert done.lines[1:9] == ["set 0", "save 0", "pack 0", "set 0", "drop 0", "unpack 0", "restore 0", "get 0 1"]
    # Read into a state that there is, as when one is saved.
    assert done.lines[9:] == ["unpack 0", "unpack 0", "get 0 2"]
    # Its bytes are made once for asking how many they are and for fetching them.
    assert done.calls.count("state_to_bytes") == 1


def test_bytes_belong_to_the_state_that_was_saved_last(run: Run, fmi: int) -> None:
    real = _real(fmi)
    words = ["new", f"set:{real}:1:1", "save", "pack:1", f"set:{real}:1:2", "save", "pack", "drop", "unpack", "restore"]
    done = run(fmi, *words, f"get:{real}:1:1", "free")
    assert done.lines[-1] == "get 0 2"
    assert "pack 3" in done.lines
    assert any(line.endswith("the array is too small for the serialized state") for line in done.lines)


def test_damaged_bytes_are_an_error(run: Run, fmi: int) -> None:
    done = run(fmi, "new", "save", "pack", "unpack:3", "restore", "free")
    assert done.lines[3].endswith("these bytes are no state")
    assert done.lines[4:] == ["unpack 3", "restore 0"]


def test_a_wrong_pointer_is_refused(run: Run, fmi: int) -> None:
    for word in ("save", "restore", "drop", "pack"):
        done = run(fmi, "new", "garbage", word, "free")
        assert done.lines[1].endswith(_NO_STATE)
        assert done.lines[2] == f"{word} 3"


def test_states_end_with_their_instance(run: Run, fmi: int) -> None:
    real = _real(fmi)
    # The host still has its pointer, and another instance: nothing is behind it.
    done = run(fmi, "new", "save", "free", "new", f"get:{real}:90:1", "restore", "free")
    assert done.lines[3] == "get 0 1"
    assert done.lines[4].endswith(_NO_STATE)
    assert done.lines[5] == "restore 3"
