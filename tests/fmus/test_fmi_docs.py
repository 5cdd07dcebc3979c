"""If this failed, the page on FMUs would show a newcomer commands or numbers that are not so."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from cardiac_cosim.cli import app as cli
from typer.testing import CliRunner

_ROOT = Path(__file__).parent.parent.parent
_PAGE = (_ROOT / "docs" / "fmi.md").read_text(encoding="utf-8")


def _block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", _PAGE, re.DOTALL)
    return text


def test_the_page_is_as_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scenarios").symlink_to(_ROOT / "scenarios")
    commands = [shlex.split(line, comments=True) for line in _block("sh").splitlines()]
    assert [words[:2] for words in commands] == [
        *[["cosim", "build"]] * 2,
        *[["python", "-m"]] * 4,
        ["cosim", "run"],
    ]
    for program, *words in commands:
        if program == "cosim":
            # Without the figures, which are the same for all versions of FMI.
            words += ["--no-figures", "--no-report"] if words[0] == "run" else []
            result = CliRunner().invoke(cli.app, words)
            assert result.exit_code == 0, result.output
        else:
            done = subprocess.run([sys.executable, *words], capture_output=True, text=True, timeout=120)
            assert done.returncode == 0, done.stderr
            assert "validate" not in words or done.stdout.strip() == "No problems found."
    shown = subprocess.run([sys.executable, "-c", _block("python")], capture_output=True, text=True, timeout=120)
    assert shown.stdout == _block("text"), shown.stderr
