"""If this failed, somebody who follows a page would be stopped by a command, a scenario or a program on it.

Every block of code of every page has to be covered by a rule here. Commands are checked by the parser of `cosim`, and
what they name by whatever reads it; small scenes are really built and run, for two steps. The whole is done by
`test_commands_as_they_stand.py`.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import typer.main
from cardiac_cosim.cli.app import app
from doc_blocks import PAGES, ROOT, Block, blocks, command_lines, inline_code, name_of
from shell_rules import SITE_COMMAND, Reader, check_benchmark
from yaml_rules import check_yaml

#: Blocks that are run as they stand by another test, which has to be there and name the page: their languages, and it.
_ELSEWHERE = {
    "docs/fmi.md": (("sh", "python", "text"), "tests/fmus/test_fmi_docs.py"),
    "docs/python.md": (("python",), "tests/docs/test_python_page.py"),
    "docs/ssp.md": (("python",), "tests/orchestrator/test_system_package.py"),
    "docs/tools/README.md": (("sh",), "tests/fmus/tools/conftest.py"),
    "docs/tools/c-host.md": (("sh", "text"), "tests/fmus/tools/test_masters.py"),
    "docs/tools/cofmupy.md": (("sh", "python", "text"), "tests/fmus/tools/test_cofmupy.py"),
    "docs/tools/ecospy.md": (("sh", "python", "text"), "tests/fmus/tools/test_masters.py"),
    "docs/tools/fmpy.md": (("python", "text"), "tests/fmus/tools/test_masters.py"),
    "docs/tools/fmu-manipulation-toolbox.md": (("sh", "python", "text"), "tests/fmus/tools/test_masters.py"),
    "docs/tools/libcosimpy.md": (("python", "text"), "tests/fmus/tools/test_masters.py"),
}

#: What makes the programs of a page shorter; the first of each pair has to be there, so that none outlives its page.
_SHORTENED = {
    "docs/own_unit.md": [('"run.participants": "native"', '"run.participants": "native", "run.stop_ms": 10')],
}


def _here(page: Path) -> list[Block]:
    languages, _ = _ELSEWHERE.get(name_of(page), ((), ""))
    return [block for block in blocks(page) if block.language not in languages]


@pytest.mark.parametrize("page", [page for page in PAGES if _here(page)], ids=name_of)
def test_a_reader_can_follow_the_page(page: Path, project: Path, cosim: Callable[..., Any]) -> None:
    reader = Reader(project, cosim)
    names: dict[str, Any] = {"__name__": "__main__"}
    shown = _here(page)
    for block in shown:
        if block.saved_as is not None:
            (project / block.saved_as).write_text(block.text, encoding="utf-8")
        if block.language == "sh":
            for line in command_lines(block.text):
                reader.follow(line)
        elif block.language == "yaml":
            check_yaml(block.text, project, [each.text for each in shown if each.language == "yaml"])
        elif block.language == "python":
            if block.saved_as is None:
                exec(compile(_shortened(block), str(block), "exec"), names)
        elif block.language == "diff":
            _check_diff(block)
        elif block.language in ("", "text"):
            _check_output(block, reader)
        else:
            raise AssertionError(f"{block}: no rule says how a block of {block.language!r} is tested; add one")
    page_says = page.read_text(encoding="utf-8")
    assert all(old in page_says for old, _ in _SHORTENED.get(name_of(page), ()))


def test_blocks_that_are_run_elsewhere_are_run_there() -> None:
    for page, (languages, test) in _ELSEWHERE.items():
        text = (ROOT / test).read_text(encoding="utf-8")
        assert f'"{Path(page).stem}"' in text or f'"{Path(page).name}"' in text, f"{test} does not name {page}"
        assert {block.language for block in blocks(ROOT / page)} >= set(languages), page


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_commands_in_the_text_exist(page: Path) -> None:
    for code in inline_code(page):
        words = code.removeprefix(".venv/bin/").split()
        if words[:1] == ["cosim"] and len(words) > 1:
            _check_mention(words)
        elif words[:2] == ["python", "-m"] and words[2].startswith("benchmarks"):
            check_benchmark(words[2:])
        elif words[:3] == ["python", "-m", "sphinx"]:
            assert words[3:] == SITE_COMMAND, code
        elif words[:1] == ["python"] and words[1:2] != ["-m"]:
            assert (ROOT / words[1]).exists(), code


def _check_mention(call: list[str]) -> None:
    """A command in the text: there is such a command, and it has the options; what it is given may be left out."""
    group: Any = typer.main.get_command(app)
    _, name, *words = call
    if name.startswith("-"):
        return
    assert name == "COMMAND" or name in group.commands, call
    known = {option for item in group.commands.get(name, group).params for option in (*item.opts, *item.secondary_opts)}
    for word in words:
        if word.startswith("--"):
            assert word.partition("=")[0] in {*known, "--help"}, call


def _shortened(block: Block) -> str:
    text = block.text
    for old, new in _SHORTENED.get(name_of(block.page), ()):
        text = text.replace(old, new)
    return text


def _check_diff(block: Block) -> None:
    """What a change adds is in the file: whoever adds a law or a geometry goes by it."""
    file: list[str] = []
    shown = 0
    for line in block.text.splitlines():
        if line.startswith("+++ b/"):
            file = (ROOT / line.removeprefix("+++ b/")).read_text(encoding="utf-8").splitlines()
        elif line.startswith("+") and line[1:].strip() != "...":
            assert line[1:] in file, f"{block}: {line}"
            shown += 1
    assert shown > 0


def _check_output(block: Block, reader: Reader) -> None:
    """A block of no language shows what a command prints, the command in front of it marked by a dollar."""
    for line in block.text.splitlines():
        if line.startswith("$ "):
            reader.follow(line.removeprefix("$ "))
        words = line.split()
        is_command = words[:1] in (["cosim"], ["python"], [".venv/bin/cosim"], [".venv/bin/python"])
        assert not is_command, f"{block}: a command outside of a block of `sh` is tested by nobody: {line}"
