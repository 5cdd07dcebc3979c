"""If these fail, a run that is far from its reference is called sound, or one that cannot be compared is."""

from math import inf, nan
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.results.comparison import Difference, Measure
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.studies.stability.accuracy import Accuracy, Judgement
from cardiac_cosim.studies.trial import DONE, FAILED, Trial


@pytest.fixture
def reference(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StoredRun:
    """One that has a volume 0.2 ml, a stress infinitely and a field that cannot be compared away from any run."""
    differences = {
        "lv_volume_ml": ("ml", Difference(0.2)),
        "activation_ms": ("ms", Difference(inf, "the probe apex is never activated")),
        "stretch": ("", Difference(nan, "stretch is on another mesh")),
    }
    known = {
        name: Measure(name, unit, name, lambda *_, found=found: found) for name, (unit, found) in differences.items()
    }
    monkeypatch.setattr("cardiac_cosim.studies.stability.accuracy.measures", lambda run, still: known)
    return StoredRun(tmp_path)


def _judged(allowed: dict[str, float], reference: StoredRun, measured: tuple[str, ...] = ()) -> Judgement:
    return Accuracy(allowed, measured, [reference], "study.yaml").judged(Trial(reference.folder, DONE), reference)


def test_an_error_is_allowed_up_to_its_tolerance(reference: StoredRun) -> None:
    assert _judged({"lv_volume_ml": 0.2}, reference) == Judgement({"lv_volume_ml": 0.2})
    judged = _judged({"lv_volume_ml": 0.19}, reference)
    assert judged.exceeded == "the error in lv_volume_ml is 0.2 ml, the tolerance 0.19"
    assert _judged({}, reference, ("lv_volume_ml",)) == Judgement({"lv_volume_ml": 0.2})


def test_an_infinite_error_is_too_large_and_says_why(reference: StoredRun) -> None:
    judged = _judged({"activation_ms": 1e9}, reference)
    assert (judged.errors, judged.exceeded) == ({"activation_ms": inf}, "the probe apex is never activated")


def test_what_cannot_be_compared_is_not_judged(reference: StoredRun) -> None:
    judged = _judged({"stretch": 1.0, "lv_volume_ml": 0.1}, reference)
    assert judged.errors == {"lv_volume_ml": 0.2}
    assert "error in lv_volume_ml" in judged.exceeded
    assert judged.unjudged == "not judged for accuracy: stretch is on another mesh"


def test_only_what_is_done_is_judged(reference: StoredRun) -> None:
    accuracy = Accuracy({"lv_volume_ml": 0.1}, (), [reference], "study.yaml")
    assert accuracy.judged(Trial(reference.folder, FAILED), reference) == Judgement()
    assert accuracy.judged(Trial(reference.folder, DONE), None) == Judgement()
    missing = accuracy.judged(Trial(reference.folder, DONE), "its reference failed")
    assert missing == Judgement(unjudged="not judged for accuracy: its reference failed")


@pytest.mark.parametrize("key", ["tolerances", "measures"])
def test_a_measure_that_there_is_not_is_told(reference: StoredRun, key: str) -> None:
    allowed, measured = ({"lv_volume": 1.0}, ()) if key == "tolerances" else ({}, ("lv_volume",))
    with pytest.raises(InputError, match=rf"^study.yaml: {key}: the scenario has no 'lv_volume'.*'lv_volume_ml'\?"):
        Accuracy(allowed, measured, [reference], "study.yaml")


def test_a_run_is_judged_against_a_reference_at_rest(tmp_path: Path) -> None:
    for name, values in (("rest", (1.0, 1.0)), ("moves", (1.0, 4.0))):
        (tmp_path / name).mkdir()
        rows = "".join(f"{time},{value}\n" for time, value in enumerate(values))
        (tmp_path / name / "timeseries.csv").write_text(f"time_ms,a_mm\n{rows}")
    rest = StoredRun(tmp_path / "rest")
    accuracy = Accuracy({"a_mm": 2.0}, (), [rest], "study.yaml")
    assert (
        accuracy.judged(Trial(tmp_path / "moves", DONE), rest).exceeded == "the error in a_mm is 3 mm, the tolerance 2"
    )
    assert accuracy.judged(Trial(tmp_path / "rest", DONE), rest) == Judgement({"a_mm": 0.0})
