"""If these fail, a run that went wrong is shown as one that can be trusted, or a sound one as a failure."""

import json
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.studies.stability.accuracy import Judgement
from cardiac_cosim.studies.stability.classify import Verdict, classified
from cardiac_cosim.studies.stability.map import (
    DIVERGED,
    INACCURATE,
    NOT_CONVERGED,
    NOT_RUN,
    OSCILLATING,
    SOUND,
    UNIT_FAILED,
)
from cardiac_cosim.studies.trial import CRASHED, DONE, FAILED, REFUSED, Trial

_GROWING = {"mechanics.stretch": {"kind": "growing", "rate": 1.3, "period_steps": 2}}
_END = {"steps": 40, "end_ms": 80.0}
_RINGING = {"mechanics.stretch": {"kind": "ringing", "rate": 0.97, "period_steps": 4, "from_ms": 40.0, "to_ms": 80.0}}
_ENDING = {"mechanics.stretch": _RINGING["mechanics.stretch"] | {"from_ms": 20.0, "to_ms": 60.0}}
_FADING = {"mechanics.stretch": _RINGING["mechanics.stretch"] | {"from_ms": 10.0}}
_DECAYING = {"mechanics.stretch": {"kind": "decaying", "rate": 0.4, "period_steps": 2}}
_UNIT = {"kind": "unit", "unit": "mechanics", "time_ms": 12.0}
_MESSAGE = "unit 'mechanics' failed in the step from 12 to 13 ms: an element is inverted; shorter steps may help. More"


def _verdict(
    folder: Path,
    status: str,
    summary: dict[str, Any],
    reason: str = "",
    judgement: Judgement | None = None,
    factor: float | None = None,
) -> Verdict:
    """The verdict on a run with this summary; with a `factor` its time series grows by it, and modes are fitted."""
    (folder / "summary.json").write_text(json.dumps(summary))
    if factor is not None:
        rows = [f"{time},{factor**time!r},{(0.3 * factor) ** time!r}\n" for time in range(60)]
        (folder / "timeseries.csv").write_text("time_ms,a,b\n" + "".join(rows))
    return classified(Trial(folder, status, reason), judgement or Judgement(), factor is not None)


@pytest.mark.parametrize(
    ("status", "summary", "kind", "measure", "words"),
    [
        (DONE, {}, SOUND, None, []),
        (DONE, {"growth": {}}, SOUND, None, []),
        (DONE, {"growth": _DECAYING}, SOUND, 0.4, []),
        (
            DONE,
            {"growth": _DECAYING | {"a.b": {"kind": "growing", "rate": 1.01, "period_steps": 2}}},
            OSCILLATING,
            1.01,
            ["a.b"],
        ),
        (DONE, {"growth": _GROWING}, OSCILLATING, 1.3, ["mechanics.stretch", "grows", "1.3", "period of 2 steps"]),
        (DONE, _END | {"growth": _RINGING}, OSCILLATING, 0.97, ["keeps ringing", "0.97", "period of 4 steps"]),
        (DONE, _END | {"growth": _ENDING}, SOUND, 0.97, []),
        (DONE, _END | {"growth": _FADING}, SOUND, 0.97, []),
        (DONE, {"unconverged_ms": [4.0, 5.0], "steps": 20}, NOT_CONVERGED, None, ["2 of 20 steps", "first to 4 ms"]),
        (DONE, {"unconverged_ms": [4.0], "steps": 9, "growth": _GROWING}, NOT_CONVERGED, 1.3, ["grows"]),
        (FAILED, {"failure": _UNIT}, UNIT_FAILED, None, ["an element is inverted"]),
        (FAILED, {"failure": _UNIT, "growth": _DECAYING}, UNIT_FAILED, 0.4, ["an element is inverted"]),
        (FAILED, {"failure": _UNIT, "growth": _GROWING}, DIVERGED, 1.3, ["an element is inverted", "grows", "1.3"]),
        (FAILED, _END | {"failure": _UNIT, "growth": _RINGING}, UNIT_FAILED, 0.97, ["keeps ringing"]),
        (FAILED, {"growth": _GROWING}, DIVERGED, 1.3, ["grows"]),
        (FAILED, {}, UNIT_FAILED, None, ["an element is inverted"]),
        (FAILED, {"failure": {"kind": "coupling"}}, NOT_CONVERGED, None, ["an element is inverted"]),
        (FAILED, {"failure": {"kind": "coupling"}, "growth": _GROWING}, NOT_CONVERGED, 1.3, ["grows"]),
        (FAILED, {"failure": {"kind": "terminated"}}, UNIT_FAILED, None, []),
        (FAILED, {"failure": {"kind": "results"}}, NOT_RUN, None, []),
        (REFUSED, {"growth": _GROWING}, NOT_RUN, None, ["an element is inverted"]),
        (CRASHED, {"growth": _GROWING}, UNIT_FAILED, None, ["an element is inverted"]),
    ],
)
def test_the_class_follows_from_what_the_run_left(
    tmp_path: Path, status: str, summary: dict[str, Any], kind: str, measure: float | None, words: list[str]
) -> None:
    verdict = _verdict(tmp_path, status, summary, "" if status == DONE else _MESSAGE)
    assert (verdict.kind, verdict.measure) == (kind, measure)
    for word in words:
        assert word in verdict.reason
    # What to try stands in the run's own summary.
    assert "More" not in verdict.reason
    assert "shorter steps" not in verdict.reason


def test_of_several_fields_the_worst_is_named(tmp_path: Path) -> None:
    fields = {
        "a.x": {"kind": "growing", "rate": 1.1, "period_steps": 2},
        "b.y": {"kind": "growing", "rate": 1.2, "period_steps": 2},
        "c.z": {"kind": "ringing", "rate": 0.99, "period_steps": 2},
    }
    verdict = _verdict(tmp_path, DONE, {"growth": fields})
    assert verdict.measure == 1.2
    assert verdict.reason.startswith("b.y")


@pytest.mark.parametrize(
    ("factor", "status", "kind"),
    [
        (-1.0 - 1e-6, DONE, OSCILLATING),
        (-1.0 + 1e-6, DONE, SOUND),
        (1.0 + 1e-6, DONE, DIVERGED),
        (1.0 - 1e-6, DONE, SOUND),
        (-1.2, FAILED, DIVERGED),
        (1.2, FAILED, DIVERGED),
        (0.9, FAILED, UNIT_FAILED),
    ],
)
def test_by_modes_the_limit_is_one_on_both_sides(tmp_path: Path, factor: float, status: str, kind: str) -> None:
    # What the run measured does not count then.
    verdict = _verdict(tmp_path, status, {"growth": _GROWING if abs(factor) < 1.0 else {}}, "x", factor=factor)
    assert verdict.kind == kind
    assert verdict.measure == pytest.approx(abs(factor), rel=1e-9)


def test_without_modes_the_runs_own_measure_counts_and_the_reason_says_why(tmp_path: Path) -> None:
    (tmp_path / "summary.json").write_text("{}")
    assert "nothing in its time series moves" in classified(Trial(tmp_path, DONE), Judgement(), True).reason
    growing = tmp_path / "growing"
    growing.mkdir()
    (growing / "summary.json").write_text(json.dumps({"growth": _GROWING}))
    assert classified(Trial(growing, DONE), Judgement(), True).kind == OSCILLATING


def test_accuracy_counts_where_nothing_worse_is_found(tmp_path: Path) -> None:
    wrong = Judgement({"a": 2.0}, exceeded="the error in a is 2 ml, the tolerance 1")
    assert _verdict(tmp_path, DONE, {}, judgement=wrong) == Verdict(INACCURATE, wrong.exceeded)
    assert _verdict(tmp_path, DONE, {"growth": _GROWING}, judgement=wrong).kind == OSCILLATING
    unknown = Judgement(unjudged="not judged for accuracy: its reference failed")
    assert _verdict(tmp_path, DONE, {}, judgement=unknown) == Verdict(SOUND, unknown.unjudged)


def test_a_long_message_is_cut(tmp_path: Path) -> None:
    assert len(_verdict(tmp_path, FAILED, {}, "x" * 10_000).reason) < 300
