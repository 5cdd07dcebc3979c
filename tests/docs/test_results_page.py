"""If this failed, the page on what a run leaves would name files, columns or keys that are not there, or miss some."""

import json
import re
from pathlib import Path

import h5py
import pytest
from cardiac_cosim.cli.app import app
from doc_blocks import ROOT
from typer.testing import CliRunner

_PAGE = (ROOT / "docs" / "reference" / "results.md").read_text(encoding="utf-8")

#: What only some runs leave, none of which are made here, by the part of the page.
_RARE = {
    "": {"fmu.log", "errors.csv", "errors.json", "errors.png", "errors.svg", "checkpoint.h5", "fields.parts"},
    "timeseries.csv": {"<chamber>_pressure_kPa"},
}


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, small_heart_file: Path) -> list[Path]:
    """A run with iterated steps and all that is drawn of it, and one with adaptive steps."""
    sets = [f"scene={{mesh: {small_heart_file}}}", "run.participants=native", "run.stop_ms=10"]
    sets.append("units.electrophysiology.parameters={stimulus_depth_mm: 5}")
    iterated, adaptive = (
        "coupling.iterate={converge: {stretch: {relative: 1e-2}}}",
        "coupling.adaptive={tolerance: 0.1}",
    )
    folders = []
    for name, change, options in (("iterated", iterated, ()), ("adaptive", adaptive, ("--no-figures",))):
        folders.append(tmp_path_factory.mktemp(name))
        assignments = [f"--set={each}" for each in (*sets, change)]
        words = ["run", str(ROOT / "scenarios" / "baseline.yaml"), "--output", str(folders[-1]), *assignments, *options]
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 0, done.output
    return folders


def _rows(part: str) -> list[str]:
    """The first cells of the table of a part of the page; "" is its beginning."""
    text = _PAGE.partition("\n## ")[0] if not part else re.split(rf"\n## [^\n]*{re.escape(part)}\n", _PAGE)[1]
    return re.findall(r"^\| `([^`]+)` \|", text.partition("\n## ")[0], re.MULTILINE)


def _check(part: str, found: set[str]) -> None:
    """Everything found has a row, and every row is found, but for what is rare."""
    rows = _rows(part)
    patterns = {row: re.compile(re.sub(r"<\w+>", r"[\\w.-]+", re.escape(row))) for row in rows}
    exact = found & set(rows)
    for name in found - exact:
        assert any(pattern.fullmatch(name) for pattern in patterns.values()), f"{part or 'files'}: {name} has no row"
    for row, pattern in patterns.items():
        if row not in _RARE.get(part, ()):
            assert any(pattern.fullmatch(name) for name in found), f"{part or 'files'}: there is no {row}"


def test_files(runs: list[Path]) -> None:
    files = {path.relative_to(folder).as_posix() for folder in runs for path in folder.rglob("*") if path.is_file()}
    _check("", {name for name in files if not name.startswith(".")})


@pytest.mark.parametrize("table", ["timeseries.csv", "coupling.csv", "iterations.csv"])
def test_columns(runs: list[Path], table: str) -> None:
    heads = [path.read_text(encoding="utf-8").splitlines()[0] for folder in runs for path in folder.glob(table)]
    _check(table, {column for head in heads for column in head.split(",")})


def test_data_sets(runs: list[Path]) -> None:
    with h5py.File(runs[0] / "fields.h5") as file:
        found: set[str] = set()
        file.visititems(lambda name, item: found.add(name) if isinstance(item, h5py.Dataset) else None)
    _check("fields.h5", found)


def test_keys_of_the_summary(runs: list[Path]) -> None:
    _check("summary.json", {key for folder in runs for key in json.loads((folder / "summary.json").read_text())})
