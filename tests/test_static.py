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


def _linted(pyproject: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    command = [str(Path(sys.executable).with_name("lint-imports")), "--no-cache", "--no-logo", *arguments]
    return subprocess.run(command, cwd=pyproject.parent, capture_output=True, text=True)


def test_imports_run_downwards_and_through_the_one_door() -> None:
    done = _linted(_ROOT / "pyproject.toml")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_linter_of_imports_sees_the_door(tmp_path: Path) -> None:
    # Without the exception for the door, it would have to be found: a contract that sees nothing keeps nothing.
    pyproject = tmp_path / "pyproject.toml"
    text = (_ROOT / "pyproject.toml").read_text(encoding="utf-8")
    door = 'ignore_imports = ["cardiac_cosim.orchestrator.participants.native -> cardiac_cosim.units.**"]'
    assert door in text
    pyproject.write_text(text.replace(door, ""), encoding="utf-8")
    done = _linted(pyproject)
    assert done.returncode == 1
    assert "One door from the orchestrator to the units BROKEN" in done.stdout
