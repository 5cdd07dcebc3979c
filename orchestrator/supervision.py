"""The command `cosim`, watched: whatever ends the working process, exit code 0 is returned for finished work only.

Foreign FMUs run inside that process. One that calls exit(0) ends it as if it had done its work, one that crashes ends
it without a word. So the work is done in a child process, and the parent, which does nothing else, says what became of
it. Signals are for the parent, as a shell sees one process only, and are passed on.
"""

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterable
from mmap import mmap

from . import activity

#: Exit code of work that was cut off by one who called it done.
_CUT_OFF = 3

#: See prctl(2).
_PR_SET_PDEATHSIG = 1

#: What is passed on to the process that works, unless this one ignores it.
_PASSED_ON = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1, signal.SIGUSR2)
_STOPPING = (signal.SIGTSTP, signal.SIGCONT)


def watch(work: Callable[[], None]) -> None:
    """Do `work` in a child process, and end this one with the exit code that fits how the child ended.

    Where the system cannot do that, the work is done here.
    """
    if sys.platform != "linux":
        work()
    else:
        os._exit(_watched(work))


def _watched(work: Callable[[], None]) -> int:
    """Do `work` in a child process, and return the exit code that this one is to have."""
    board = activity.Board(mmap(-1, activity.SIZE))
    heard = [number for number in (*_PASSED_ON, *_STOPPING) if signal.getsignal(number) is not signal.SIG_IGN]
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGCHLD, *heard])
    parent, child = os.getpid(), os.fork()
    if child == 0:
        # A group of its own: what a terminal sends to all of its foreground reaches the parent, and from there once.
        os.setpgid(0, 0)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        end_with(parent)
        activity.show_on(board)
        _end(board, work)
    return _verdict(_wait(child, heard), board)


def _end(board: activity.Board, work: Callable[[], None]) -> None:
    """Do `work` and leave the process as Python leaves it, having said so."""
    try:
        work()
    except SystemExit as end:
        board.end(end.code if isinstance(end.code, int) else int(end.code is not None))
        raise
    except BaseException:
        board.end(1)
        raise
    board.end(0)
    sys.exit(0)


def end_with(parent: int) -> None:
    """On Linux, have this process killed when its `parent` has ended."""
    if sys.platform != "linux":
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def _wait(child: int, heard: Iterable[int]) -> int:
    """Pass signals on until the process `child` has ended; its status as `os.waitpid` gives it."""
    while True:
        number = signal.sigwait([signal.SIGCHLD, *heard])
        if number == signal.SIGCHLD:
            ended, status = os.waitpid(child, os.WNOHANG)
            if ended:
                return status
        elif number == signal.SIGTSTP:
            os.kill(child, signal.SIGSTOP)
            os.kill(os.getpid(), signal.SIGSTOP)
        else:
            os.kill(child, number)


def _verdict(status: int, board: activity.Board) -> int:
    """The exit code for a process that ended with `status`, and a line where it did not end of itself."""
    if board.ended is not None:
        # What crashes when all is done and the process is only being cleared away takes nothing back.
        return board.ended
    killed = os.WIFSIGNALED(status)
    number = os.WTERMSIG(status) if killed else os.waitstatus_to_exitcode(status)
    where = board.read()
    if killed and not where and number in _PASSED_ON:
        return 128 + number
    how = f"was ended by {signal.Signals(number).name}" if killed else f"was ended by a call of exit({number})"
    who = f"in {where}, which ended all of `cosim`" if where else "outside of any unit"
    sys.stderr.write(
        f"failed: the process {how} {who}. Results up to the last step are in the results folder; "
        "run that unit in a process of its own with run.workers=processes\n"
    )
    sys.stderr.flush()
    return 128 + number if killed else number or _CUT_OFF
