"""If these fail, a person cannot get the page of a run, or gets that of another one."""

import os
import shutil
from pathlib import Path

import pytest
from cardiac_cosim.cli.app import main
from cardiac_cosim.orchestrator.results.lock import FolderLock
from report_kinds import RunOf


def _cosim(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    monkeypatch.setattr("sys.argv", ["cosim", *map(str, arguments)])
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def test_a_run_says_where_its_page_is_and_leaves_none_of_an_earlier_run(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["run", small_scenario, "--output", tmp_path / "out", "--set", "run.stop_ms=1", "--no-figures"]
    page = tmp_path / "out" / "report.html"
    assert _cosim(monkeypatch, *arguments) == 0
    assert f"open {page} in a browser" in capsys.readouterr().out
    assert page.is_file()
    assert _cosim(monkeypatch, *arguments, "--no-report") == 0
    assert "in a browser" not in capsys.readouterr().out
    assert not page.exists()


def test_a_run_that_fails_says_where_its_page_is(
    small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    iterate = "coupling.iterate={max_iterations: 1, converge: {stretch: {relative: 1e-9}}}"
    out = tmp_path / "out"
    arguments = ["run", small_scenario, "--output", out, "--set", "run.stop_ms=5", "--set", iterate, "--no-figures"]
    assert _cosim(monkeypatch, *arguments) == 3
    told = capsys.readouterr().err
    assert f"to look at the results up to the failure, open {out / 'report.html'} in a browser" in told
    assert told.rstrip().rpartition("\n")[2].startswith("failed: ")
    assert "The run failed" in (out / "report.html").read_text()


def test_page_and_figures_are_made_again(
    run_of: RunOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(run_of("heart").folder, out)
    before = (out / "report.html").read_bytes()
    (out / "report.html").unlink()
    assert _cosim(monkeypatch, "report", out) == 0
    assert capsys.readouterr().out.strip() == str(out / "report.html")
    assert (out / "report.html").read_bytes() == before
    assert list((out / "figures").glob("*.png"))
    assert not (out / ".lock").exists()


def test_figures_show_the_times_that_are_asked_for_and_refuse_others(
    run_of: RunOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(run_of("heart").folder, out)
    picture = out / "figures" / "potential_snapshots.png"
    assert _cosim(monkeypatch, "report", out) == 0
    chosen = picture.read_bytes()
    assert _cosim(monkeypatch, "report", out, "--times", "0") == 0
    assert picture.read_bytes() != chosen
    capsys.readouterr()
    for times, told in (("0,5000", "5000 ms"), ("early", "separated by commas")):
        assert _cosim(monkeypatch, "report", out, "--times", times) == 2
        assert told in capsys.readouterr().err


def test_a_folder_without_results_is_refused_and_stays_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for folder in (tmp_path, tmp_path / "missing"):
        assert _cosim(monkeypatch, "report", folder) == 2
        told = capsys.readouterr().err
        assert f"{folder}: there are no results of a run in this folder" in told
        assert "cosim run" in told
    assert os.listdir(tmp_path) == []


def test_a_run_that_goes_on_is_left_alone(
    run_of: RunOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(run_of("cell").folder, out)
    lock = FolderLock(out)
    try:
        assert _cosim(monkeypatch, "report", out) == 2
    finally:
        lock.release()
    assert "in use" in capsys.readouterr().err


def test_damaged_results_are_named(
    run_of: RunOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(run_of("cell").folder, out)
    (out / "fields.h5").write_bytes(b"not HDF5")
    assert _cosim(monkeypatch, "report", out) == 2
    assert f"{out}: report.html cannot be made" in capsys.readouterr().err
