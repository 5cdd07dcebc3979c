"""A folder that looks like the project's to whoever follows a page."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from cardiac_cosim.units.registry import UNITS
from doc_blocks import ROOT


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder, in which the test is; what pages write there, import from there and register goes with it."""
    for name in ("benchmarks", "docs", "scenarios", "tests", "setup.sh", "pyproject.toml"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    units, modules = dict(UNITS), set(sys.modules)
    yield tmp_path
    UNITS.clear()
    UNITS.update(units)
    for name in set(sys.modules) - modules:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(tmp_path)):
            del sys.modules[name]
