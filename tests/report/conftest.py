"""What the tests of reports share: the meaning of a broken pipe."""

import signal
import sys

import pytest


@pytest.fixture(autouse=True)
def _broken_pipes_are_errors() -> None:
    """As Python begins with: tests that use gmsh by themselves leave its way behind, which ends the process."""
    if sys.platform != "win32":
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
