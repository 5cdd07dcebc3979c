"""The pages of the documentation in pieces: blocks of code, and pieces of code in the text."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]

#: All that is read by people who set the project up, use it or change it.
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])

#: A first line that says what a block is to be saved as.
_SAVED = re.compile(r"^# ([\w.-]+\.(?:py|yaml))$")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language (what follows the fence, "" for nothing), its text and the line it begins in."""

    page: Path
    language: str
    text: str
    line: int

    def __str__(self) -> str:
        return f"{name_of(self.page)}:{self.line}"

    @property
    def saved_as(self) -> str | None:
        """The file that the block is, where its first line is a comment that names one."""
        found = _SAVED.match(self.text.partition("\n")[0])
        return found and found[1]


def name_of(page: Path) -> str:
    """A page as people call it, relative to the project."""
    return page.relative_to(ROOT).as_posix()


def blocks(page: Path) -> list[Block]:
    """The blocks of a page in order, those that are inside of lists and quotations too."""
    tokens = MarkdownIt().parse(page.read_text(encoding="utf-8"))
    return [
        Block(page, token.info.strip(), token.content, token.map[0] + 1)
        for token in tokens
        if token.type in ("fence", "code_block") and token.map is not None
    ]


def inline_code(page: Path) -> Iterator[str]:
    """What stands between backquotes in the text of a page."""
    for token in MarkdownIt().enable("table").parse(page.read_text(encoding="utf-8")):
        for inner in token.children or ():
            if inner.type == "code_inline":
                yield inner.content


def command_lines(text: str) -> Iterator[str]:
    """The commands of a block for a shell, one after the other; continued lines are joined, and `&&` parts two."""
    for line in text.replace("\\\n", " ").splitlines():
        for command in line.split("&&"):
            if command.strip() and not command.strip().startswith("#"):
                yield command.strip()
