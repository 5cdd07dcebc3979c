"""If these fail, a host is told what it did not want to know, or not what it has to know."""

from collections.abc import Callable
from typing import Any

Run = Callable[..., Any]


def _told(run: Run, fmi: int, *words: str) -> list[str]:
    kind = "Real" if fmi == 2 else "Float64"
    done = run(fmi, *words, f"set:{kind}:95:0", f"set:{kind}:96:0", f"set:{kind}:99:0", "free", quiet=True)
    assert [line for line in done.lines if line.startswith("set")] == ["set 1", "set 2", "set 3"]
    return [line.split()[2] for line in done.lines if line.startswith("log ") and ": " in line]


def test_without_logging_failures_are_told_where_the_standard_allows_it(run: Run, fmi: int) -> None:
    # In FMI 2 loggingOn is about debugging; in FMI 3 a logger that was not asked for is not called.
    assert _told(run, fmi, "new") == (["logStatusError", "invalidInput"] if fmi == 2 else [])


def test_with_logging_warnings_are_told_too(run: Run, fmi: int) -> None:
    assert _told(run, fmi, "loud", "new") == ["logStatusWarning", "logStatusError", "invalidInput"]


def test_a_host_that_chooses_gets_what_it_chose(run: Run, fmi: int) -> None:
    assert _told(run, fmi, "new", "log:on") == ["logStatusWarning", "logStatusError", "invalidInput"]
    assert _told(run, fmi, "loud", "new", "log:off") == []
    assert _told(run, fmi, "loud", "new", "log:off:logStatusWarning,logStatusError") == ["invalidInput"]
    assert _told(run, fmi, "loud", "new", "log:off", "log:on:logStatusWarning") == ["logStatusWarning"]


def test_an_unknown_category_is_refused_and_changes_nothing(run: Run, fmi: int) -> None:
    for wrong in ("logAll", "NULL"):
        done = run(fmi, "new", f"log:off:logStatusError,{wrong}", "sets:1:NULL", "free")
        assert done.lines[2] == "log 3"
        assert "there are logStatusError, logStatusWarning and invalidInput" in done.lines[1]
        assert "a text to be set is NULL" in done.lines[3]
