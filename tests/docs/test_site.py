"""If these failed, the site would not be built, could not be read without a network, or would lead nowhere."""

import importlib
import re
import subprocess
import sys
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from doc_blocks import ROOT
from lxml import html
from shell_rules import SITE_COMMAND

#: Attributes by which a page has something loaded; a link, which a person follows, is none.
_LOADED = (
    "//script/@src | //img/@src | //link[not(@rel='canonical')]/@href | //iframe/@src | //source/@src | //object/@data"
)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built by the command of the pages with every warning an error; its notebooks are executed."""
    folder = tmp_path_factory.mktemp("site")
    strict = ["--fail-on-warning", "--keep-going", "--nitpicky", "--fresh-env", "--quiet"]
    command = [sys.executable, "-m", "sphinx", *strict, *SITE_COMMAND[:-1], str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Any]:
    """The pages, parsed, by their files."""
    return {path: html.parse(str(path)) for path in sorted(site.rglob("*.html"))}


def test_nothing_is_loaded_from_elsewhere(site: Path, pages: dict[Path, Any]) -> None:
    for path, page in pages.items():
        for place in page.xpath(_LOADED):
            assert not urlsplit(place).scheme or place.startswith("data:"), f"{path}: {place}"
            assert not place.startswith("/"), f"{path}: {place}"
    for path in site.rglob("*.css"):
        for place in re.findall(r"(?:url\(\s*|@import\s+)['\"]?([^'\")\s;]+)", path.read_text(encoding="utf-8")):
            assert not urlsplit(place).scheme or place.startswith("data:"), f"{path}: {place}"


def test_every_link_inside_leads_somewhere(pages: dict[Path, Any]) -> None:
    anchors = {path: {*page.xpath("//@id"), *page.xpath("//a/@name"), ""} for path, page in pages.items()}
    for path, page in pages.items():
        for link in page.xpath("//a/@href | //img/@src"):
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.is_file(), f"{path}: {link}"
            if target in anchors and target.name != "search.html":
                assert unquote(parts.fragment) in anchors[target], f"{path}: {link}"


def test_it_opens_at_the_first_page_and_is_searched_without_a_server(site: Path) -> None:
    assert 'url=docs/index.html"' in (site / "index.html").read_text(encoding="utf-8")
    # The index is a script: browsers load no data from files.
    assert (site / "searchindex.js").read_text(encoding="utf-8").startswith("Search.setIndex(")
    assert "windkessel" in (site / "searchindex.js").read_text(encoding="utf-8")


def test_equations_are_part_of_the_page(site: Path, pages: dict[Path, Any]) -> None:
    page = pages[site / "docs" / "own_unit.html"]
    assert len(page.xpath("//*[local-name()='math' and @display='block']//*[local-name()='mfrac']")) == 3
    for path, each in pages.items():
        # What was not taken for an equation would stand there as it was written.
        text = " ".join(each.xpath("//article//text()[not(ancestor::pre or ancestor::code or ancestor::script)]"))
        assert "$" not in text, path


def test_an_equation_that_cannot_be_shown_ends_the_build(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT / "docs" / "extensions")
    mathml = importlib.import_module("mathml")
    assert "<mfrac>" in mathml.as_mathml(r"\frac{a}{b}", as_block=False)
    # Lines that are aligned at their ampersands.
    assert mathml.as_mathml("a &= b \\\\\n c &= d", as_block=True).count("<mtr>") == 2
    with pytest.raises(Exception, match="unknown"):
        mathml.as_mathml(r"\unknown{a}", as_block=True)


def test_the_notebook_was_executed(site: Path, pages: dict[Path, Any]) -> None:
    page = pages[site / "docs" / "notebooks" / "first_heartbeat.html"]
    printed = " ".join(page.xpath("//div[contains(@class, 'cell_output')]//text()"))
    found = re.search(r"apex: activated at ([\d.]+) ms", printed)
    assert found is not None
    assert float(found[1]) == pytest.approx(107.0, abs=2.0)
    assert "root mean square over the mesh" in printed
    assert len(page.xpath("//div[contains(@class, 'cell_output')]//img")) == 3


def test_notebooks_are_kept_without_outputs() -> None:
    for path in (ROOT / "docs").rglob("*.ipynb"):
        assert '"outputs": []' in path.read_text(encoding="utf-8")
        assert "image/png" not in path.read_text(encoding="utf-8"), "clear its outputs before it is kept"
