"""If this failed, the code would not be what the linter, the formatter and the type checker say of it."""

import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize("command", ["ruff check .", "ruff format --check .", "mypy"])
def test_static_checks_are_clean(command: str) -> None:
    done = subprocess.run([sys.executable, "-m", *command.split()], cwd=_ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
