"""If these fail, a run that was cut off in the middle passes for one that is done, or nobody learns who cut it off."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

_WATCHED = """
import ctypes, os, signal, sys, time
from cardiac_cosim.orchestrator.activity import doing
from cardiac_cosim.orchestrator.supervision import watch

def work():
    {work}

watch(work)
"""


def _run(work: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", _WATCHED.format(work=work)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize(
    ("work", "code"),
    [("print('done')", 0), ("sys.exit(2)", 2), ("sys.exit('no')", 1), ("sys.exit(130)", 130), ("1 / 0", 1)],
)
def test_work_that_ends_of_itself_keeps_its_exit_code(work: str, code: int) -> None:
    ended = _run(work)
    assert ended.returncode == code
    assert "failed:" not in ended.stderr
    assert ("done" in ended.stdout) == (code == 0)


@pytest.mark.parametrize("native", ["exit(0)", "_exit(0)", "quick_exit(0)", "exit(7)"])
def test_an_exit_from_foreign_code_is_no_success_and_names_whose_it_was(native: str) -> None:
    ended = _run(f"with doing(\"unit 'a'\"): ctypes.CDLL(None).{native}")
    assert ended.returncode == (7 if "7" in native else 3)
    assert ended.stderr.startswith(f"failed: the process was ended by a call of exit({native[-2]}) in unit 'a'")
    assert ended.stderr.count("\n") == 1


@pytest.mark.parametrize("number", [signal.SIGSEGV, signal.SIGABRT, signal.SIGKILL, signal.SIGFPE])
def test_a_crash_is_told_in_one_line(number: signal.Signals) -> None:
    ended = _run(f"with doing(\"unit 'b'\"): os.kill(os.getpid(), {number:d})")
    assert ended.returncode == 128 + number
    assert f"ended by {number.name} in unit 'b'" in ended.stderr
    assert ended.stderr.count("\n") == 1


def test_a_unit_that_has_returned_is_not_blamed() -> None:
    ended = _run("exec('with doing(\"unit a\"): pass'); ctypes.CDLL(None).exit(0)")
    assert ended.returncode == 3
    assert "unit a" not in ended.stderr


def test_a_crash_in_clearing_away_takes_finished_work_not_back() -> None:
    ended = _run("import atexit; atexit.register(os.abort)")
    assert (ended.returncode, ended.stderr) == (0, "")


def _started(tmp_path: Path, prepare: str = "pass") -> "subprocess.Popen[str]":
    """Watched work that waits, once it is prepared and has written its number to a file."""
    work = f"{prepare}; open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    process = subprocess.Popen(
        [sys.executable, "-c", _WATCHED.format(work=work)], text=True, stderr=subprocess.PIPE, stdout=subprocess.PIPE
    )
    for _ in range(600):
        if (tmp_path / "pid").is_file() and (tmp_path / "pid").read_text():
            return process
        time.sleep(0.05)
    raise TimeoutError("the work did not begin")


def test_signals_are_passed_on_once(tmp_path: Path) -> None:
    # Not SIGINT, which whoever is started in the background may have to ignore.
    process = _started(tmp_path, "signal.signal(signal.SIGTERM, lambda *_: sys.exit(42))")
    process.terminate()
    process.communicate(timeout=30)
    assert process.returncode == 42


def test_a_signal_that_ends_the_work_is_no_fault_of_it(tmp_path: Path) -> None:
    process = _started(tmp_path)
    process.terminate()
    _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (128 + signal.SIGTERM, "")


def test_the_work_dies_with_the_process_that_watches_it(tmp_path: Path) -> None:
    process = _started(tmp_path)
    process.kill()
    process.communicate(timeout=30)
    child = int((tmp_path / "pid").read_text())
    for _ in range(100):
        try:
            os.kill(child, 0)
        except ProcessLookupError:
            return
        if "Z" in Path(f"/proc/{child}/stat").read_text().rpartition(")")[2]:
            return
        time.sleep(0.1)
    pytest.fail("the process that worked outlived the one that watched it")
