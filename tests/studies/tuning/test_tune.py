"""If these fail, `cosim tune` hands somebody a scenario that does not run, or errs by more than it says."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas
import pytest
from cardiac_cosim.orchestrator.results.comparison import measures
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.studies.plan import plan_study
from cardiac_cosim.studies.tuning.options import options_of_study
from cardiac_cosim.studies.tuning.references import references_of

_STUDY = """\
name: steps
scenario: short.yaml
reference: {coupling.step_ms: 0.25}
lines:
  - name: held
    vary: {coupling.step_ms: [5, 2.5, 0.5]}
  - name: linear
    set: {coupling.interpolation: linear, coupling.extrapolation: 1}
    vary: {coupling.step_ms: [5, 2.5, 1]}
"""


@pytest.fixture
def study(strand: Path) -> Path:
    path = strand.parent / "steps.yaml"
    path.write_text(_STUDY)
    return path


@pytest.mark.long
def test_a_strand_is_tuned_into_a_scenario_that_keeps_the_tolerance(
    strand: Path, tmp_path: Path, cosim: Callable[..., Any]
) -> None:
    out = tmp_path / "out"
    ended = cosim("tune", strand, "--tolerance", "activation_ms=0.05", "--output", out)
    assert ended.code == 0, ended.err
    assert "keeps activation_ms within 0.05 ms" in ended.out
    assert "against" in ended.out
    path = out / "short.tuned.yaml"
    assert str(path) in ended.out
    text = path.read_text()
    # What a person wrote is there, and what it was tuned to in front of it.
    assert text.startswith("# Tuned from short.yaml")
    assert "# A short strand.\n" in text
    assert "# the wave" in text
    tuned = load_scenario(path)
    assert tuned.output.every_ms == 5.0
    # The error is that of the tuned scenario, against a reference that is run here by itself.
    reference = simulate(strand, references_of(load_scenario(strand), False)[0], output=tmp_path / "reference")
    run = simulate(path, {}, output=tmp_path / "run")
    error = measures(reference)["activation_ms"].between(run, reference).value
    assert error <= 0.05
    table = pandas.read_csv(out / "tune.csv")
    best = table[(table.meets == 1) & (table.line != "the scenario as it is")]
    assert any(best.error_activation_ms.sub(error).abs() < 1e-12)
    assert table.margin_activation_ms.dropna().sub(1 - table.error_activation_ms / 0.05).abs().max() < 1e-12
    # All that was considered has results or a reason.
    assert set(table.status) == {"done", "pruned"}
    assert table[table.status == "pruned"].reason.str.contains("finer than a point|differs little").all()
    assert table.iloc[0].line == "the scenario as it is"
    assert json.loads((out / "tune.json").read_text())["limits"] == {"activation_ms": 0.05}
    assert (out / "tune.png").is_file()
    assert (out / "tune.html").is_file()


def test_a_tolerance_that_nothing_keeps_ends_with_what_comes_nearest(
    strand: Path, tmp_path: Path, cosim: Callable[..., Any]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    # What an earlier search has found is not to be taken for the answer.
    (out / "short.tuned.yaml").write_text("old")
    short = ("--set", "run.stop_ms=15")
    ended = cosim("tune", strand, *short, "--tolerance", "activation_ms=1e-9", "--output", out)
    assert ended.code == 3
    assert "none of" in ended.err
    assert "the nearest is" in ended.err
    assert "activation_ms within 1e-09 ms" in ended.err
    assert not (out / "short.tuned.yaml").exists()
    table = pandas.read_csv(out / "tune.csv")
    assert not (table.meets == 1).any()
    assert (table.status == "done").any()


def test_a_study_is_the_whole_choice_and_what_was_run_of_it_is_not_run_again(
    strand: Path, study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cosim: Callable[..., Any]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cosim("chart", study).code == 0
    points = tmp_path / "results" / "steps" / "points"
    before = {path.parent.name: path.stat().st_mtime_ns for path in points.glob("*/summary.json")}
    assert len(before) == 7
    ended = cosim("tune", strand, "--study", study, "--tolerance", "activation_ms=0.05")
    assert ended.code == 0, ended.err
    after = {path.parent.name: path.stat().st_mtime_ns for path in points.glob("*/summary.json")}
    assert {name: after[name] for name in before} == before
    # The scenario as it is: linear inputs are another setting than its own.
    assert len(after) == 8
    folder = tmp_path / "results" / "steps"
    assert load_scenario(folder / "short.tuned.yaml").coupling.step_ms in (5.0, 2.5, 1.0, 0.5)
    assert (folder / "chart.csv").is_file()
    assert set(pandas.read_csv(folder / "tune.csv").line) == {"the scenario as it is", "held", "linear"}


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ["--tolerance is missing"]),
        (("--tolerance", "activation=1"), ["activation", "did you mean 'activation_ms'"]),
        (("--tolerance", "activation_ms"), ["activation_ms", "measure=limit"]),
        (("--tolerance", "activation_ms=fast"), ["'fast' is not a number"]),
        (("--tolerance", "activation_ms=-1"), ["above 0"]),
        (("--tolerance", "activation_ms=nan"), ["finite number above 0"]),
        (("--tolerance", "activation_ms=1", "--tolerance", "activation_ms=2"), ["keep one of the two"]),
        (("--tolerance", "stretch=1", "--mesh"), ["stretch", "every mesh", "activation_ms"]),
        (("--tolerance", "activation_ms=1", "--workers", 2, "--scheduler", "tcp://x:1"), ["one of the two"]),
        (("--tolerance", "activation_ms=1", "--set", "run.stop=1"), ["run.stop", "did you mean 'stop_ms'"]),
        (("--tolerance", "activation_ms=1", "--study", "steps.yaml", "--mesh"), ["--mesh"]),
    ],
)
def test_what_is_wrong_is_told_before_any_reference_is_run(
    strand: Path, tmp_path: Path, cosim: Callable[..., Any], arguments: tuple[object, ...], words: list[str]
) -> None:
    ended = cosim("tune", strand, *arguments, "--output", tmp_path / "out")
    assert ended.code == 2, ended.err
    for word in words:
        assert word in ended.err
    assert len(list((tmp_path / "out").glob("points/*"))) <= 1


def test_a_study_of_another_scenario_is_refused(strand: Path, study: Path, cosim: Callable[..., Any]) -> None:
    other = strand.with_name("other.yaml")
    other.write_text(strand.read_text())
    ended = cosim("tune", other, "--study", study, "--tolerance", "activation_ms=1", "--output", strand.parent / "out")
    assert ended.code == 2
    assert "other.yaml" in ended.err
    assert str(study) in ended.err


def test_a_package_is_refused(tmp_path: Path, cosim: Callable[..., Any]) -> None:
    ended = cosim("tune", tmp_path / "x.ssp", "--tolerance", "activation_ms=1")
    assert ended.code == 2
    assert "YAML" in ended.err


def test_points_of_a_study_are_ordered_by_how_fine_they_are(study: Path) -> None:
    plan = plan_study(study)
    options = options_of_study(plan, load_scenario(study.with_name("short.yaml")))
    held, linear = options[:3], options[3:]
    assert held[1].candidate.is_finer(held[0].candidate)
    assert held[2].candidate.is_finer(held[1].candidate)
    assert not held[0].candidate.is_finer(held[1].candidate)
    assert not linear[1].candidate.is_finer(held[0].candidate)
