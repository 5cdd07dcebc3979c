"""Writes the results of a benchmark between its two markers on a page."""

from pathlib import Path

README = Path(__file__).parent.parent / "README.md"


def write_between(page: Path, name: str, text: str) -> None:
    """Replace the lines between `<!-- name: … -->` and `<!-- /name -->` in `page` by `text`."""
    lines = page.read_text(encoding="utf-8").split("\n")
    begin = next(number for number, line in enumerate(lines) if line.startswith(f"<!-- {name}:"))
    end = lines.index(f"<!-- /{name} -->")
    page.write_text("\n".join([*lines[: begin + 1], text.rstrip("\n"), *lines[end:]]), encoding="utf-8")
