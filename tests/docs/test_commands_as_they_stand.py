"""If this failed, a command of a page would not do what it is shown for.

All calls of `cosim` on a page are run as they stand, in its order, and its programs with them. Together they take hours
on a small machine; `test_pages.py` checks the same blocks, and those for other programs, in seconds.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from doc_blocks import PAGES, Block, blocks, command_lines, name_of
from shell_rules import EXCEPTIONS

pytestmark = pytest.mark.long


def _commands(block: Block) -> list[str]:
    lines = list(command_lines(block.text)) if block.language == "sh" else []
    if block.language == "text":
        lines = [line.removeprefix("$ ") for line in block.text.splitlines() if line.startswith("$ ")]
    return [line for line in lines if line.split()[0].rpartition("/")[2] == "cosim"]


def _follows(page: Path) -> bool:
    return any(_commands(block) for block in blocks(page)) and "/tools/" not in name_of(page)


@pytest.mark.parametrize("page", [page for page in PAGES if _follows(page)], ids=name_of)
def test_commands_do_what_they_are_shown_for(page: Path, project: Path) -> None:
    programs: list[str] = []
    for block in blocks(page):
        if block.saved_as is not None:
            (project / block.saved_as).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            # With those before it, whose names it may use, in a process of its own, which it may change.
            programs.append(block.text)
            _run([sys.executable, "-c", "\n".join(programs)], str(block))
        for line in _commands(block):
            kept = " ".join(word for word in line.split(" ") if word not in EXCEPTIONS)
            _run(["bash", "-c", kept], f"{block}: {line}")


def _run(command: list[str], told: str) -> None:
    environment = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{told}\n{done.stdout}\n{done.stderr}"
