"""If these fail, nobody can find out which version they have, or their shell completes nothing, or what is wrong."""

import os
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.cli.completion import FMUS, SCENARIOS, files_ending

_COSIM = [sys.executable, "-c", "import sys; sys.argv[0] = 'cosim'; from cardiac_cosim.cli.app import main; main()"]


def _completed(words: str, folder: Path) -> list[str]:
    """What bash is told of a line that ends where the cursor is."""
    place = {"COMP_WORDS": words, "COMP_CWORD": str(len(words.split(" ")) - 1), "_COSIM_COMPLETE": "complete_bash"}
    done = subprocess.run(_COSIM, env=os.environ | place, cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.stderr == ""
    return done.stdout.split("\n")[:-1]


def test_the_version_is_that_of_the_package(cosim: Callable[..., Any]) -> None:
    ended = cosim("--version")
    assert (ended.code, ended.out) == (0, f"cosim {version('cardiac-cosim')}\n")


def test_the_shell_completes_commands_options_and_files(tmp_path: Path) -> None:
    (tmp_path / "scenes").mkdir()
    for name in ("scenes/one.yaml", "scenes/two.yaml", "scenes/notes.md", "system.ssp"):
        (tmp_path / name).write_text("")
    assert _completed("cosim ru", tmp_path) == ["run"]
    assert "--verbose" in _completed("cosim run --verb", tmp_path)
    assert _completed("cosim run s", tmp_path) == ["scenes/one.yaml", "scenes/two.yaml", "system.ssp"]
    assert _completed("cosim schema st", tmp_path) == ["study", "stability"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_shown_and_installed_for_a_shell(shell: str, tmp_path: Path) -> None:
    home = os.environ | {"HOME": str(tmp_path), "ZDOTDIR": str(tmp_path), "XDG_CONFIG_HOME": str(tmp_path / ".config")}
    detection = {"_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    for option in ("--show-completion", "--install-completion"):
        done = subprocess.run(
            [*_COSIM, option, shell], env=home | detection, capture_output=True, text=True, timeout=60
        )
        assert done.returncode == 0, done.stderr
        assert "omplet" in done.stdout
    written = [path.read_text() for path in tmp_path.rglob("*") if path.is_file()]
    assert any(f"complete_{shell}" in text for text in written)


def test_files_are_completed_by_their_endings_and_through_folders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a.yaml", "b.YAML", "c.fmu", "deep/d.yaml", "deep/er/e.ssp", "deep/er/still/f.yaml", ".hidden/g.yaml"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text("")
    (tmp_path / "folder.yaml").mkdir()
    monkeypatch.chdir(tmp_path)
    scenarios = files_ending(*SCENARIOS)
    assert scenarios("") == ["a.yaml", "b.YAML", "deep/d.yaml", "deep/er/e.ssp"]
    assert scenarios("deep/er/") == ["deep/er/e.ssp", "deep/er/still/f.yaml"]
    assert scenarios("./a") == ["./a.yaml"]
    assert scenarios(".h") == [".hidden/g.yaml"]
    assert scenarios(f"{tmp_path}/b") == [f"{tmp_path}/b.YAML"]
    assert scenarios("nowhere/") == []
    assert files_ending(*FMUS)("") == ["c.fmu"]


@pytest.mark.parametrize(
    "command", ["run", "build", "show", "chart", "errors", "stability", "tune", "verify", "schema", "sweep", "compare"]
)
def test_every_command_and_each_of_its_options_is_described(command: str) -> None:
    from cardiac_cosim.cli.app import app
    from typer.main import get_command

    described = get_command(app).commands[command]  # type: ignore[attr-defined]
    assert described.help.strip().split("\n")[0].endswith(".")
    for parameter in described.params:
        assert parameter.name == "help" or str(parameter.help).endswith("."), parameter.name
