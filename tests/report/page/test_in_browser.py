"""If these fail, whoever opens report.html sees nothing, or something else than what was computed."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.report.page import write_page
from report_kinds import OTHERS, RunOf
from report_look import Look

_SCENARIOS = Path(__file__).parents[3] / "scenarios"

LookAt = Callable[..., Look]


def _page(run: StoredRun) -> Path:
    return run.folder / "report.html"


def _check(run: StoredRun, seen: Look) -> None:
    """What every report has."""
    assert seen.page.inner_text("h1").startswith(run.summary["name"])
    assert seen.page.locator("#trouble").is_hidden()
    # Nothing is wider than the window, but what scrolls by itself.
    assert seen.page.evaluate("document.documentElement.scrollWidth <= window.innerWidth")
    has_body = run.points_mm is not None and len(run.points_mm) > 1 and len(run.frames_ms) > 0
    assert seen.page.locator("#heart canvas").count() == (1 if has_body else 0)
    for name in ("curves", "coupling"):
        figure = seen.page.locator(f"#{name}")
        for place in range(figure.count()):
            assert figure.nth(place).locator("path.js-line").count() > 0


@pytest.mark.parametrize("kind", OTHERS)
def test_reports_of_all_kinds_open_without_a_complaint(kind: str, run_of: RunOf, look: LookAt) -> None:
    _check(run_of(kind), look(_page(run_of(kind)), 375 if kind == "strand" else 1280))


def test_the_body_is_where_it_was_computed_at_three_times(run_of: RunOf, look: LookAt) -> None:
    run = run_of("heart")
    seen = look(_page(run))
    _check(run, seen)
    points = run.points_mm
    assert points is not None
    for frame in (3, 8, 0):
        seen.go_to(frame)
        assert seen.time_ms == run.frames_ms[frame]
        moved = run.frame("displacement_mm", frame)
        assert moved is not None
        drawn = np.array(seen.trace(0, "x", "y", "z")).T
        computed = (points + moved).astype(np.float32)
        # Every vertex is one of the nodes to the last bit, and all nodes of the surface are there.
        assert {tuple(row) for row in drawn.astype(np.float32)} <= {tuple(row) for row in computed}
        assert len(np.unique(drawn, axis=0)) > 200
        # And each has that node's potential, but for the steps between colours.
        node = {tuple(row): number for number, row in enumerate(computed)}
        potential = run.frame("potential_mV", frame)
        assert potential is not None
        expected = potential[[node[tuple(row)] for row in drawn.astype(np.float32)]]
        np.testing.assert_allclose(seen.trace(0, "intensity")[0], expected, atol=2e-3)


def test_time_is_one_for_body_curves_and_keys(run_of: RunOf, look: LookAt) -> None:
    run = run_of("heart")
    seen = look(_page(run))
    assert (seen.time_ms, seen.cursor_ms) == (0.0, 0.0)
    seen.go_to(4)
    assert (seen.time_ms, seen.cursor_ms) == (20.0, 20.0)
    seen.page.locator("h1").click()
    seen.page.keyboard.press("ArrowRight")
    seen.settle()
    assert (seen.time_ms, seen.cursor_ms) == (25.0, 25.0)

    # A click in the lowest panel, at 10 ms.
    before = seen.trace(0, "x")
    seen.page.locator("#curves .nsewdrag").last.scroll_into_view_if_needed()
    box = seen.page.locator("#curves .nsewdrag").last.bounding_box()
    assert box is not None
    seen.page.mouse.click(box["x"] + 10.2 / 40.0 * box["width"], box["y"] + 0.5 * box["height"])
    seen.until("document.getElementById('now').textContent === '10 ms'")
    seen.settle()
    assert seen.cursor_ms == 10.0
    assert seen.trace(0, "x") != before

    # And it plays, and pauses.
    seen.page.keyboard.press(" ")
    seen.until("Number(document.getElementById('time').value) >= 2")
    assert "Pause" in seen.page.inner_text("#play")
    seen.page.click("#play")
    seen.settle()
    stopped, shape = seen.time_ms, seen.trace(0, "x")
    seen.page.wait_for_timeout(700)
    assert (seen.time_ms, seen.trace(0, "x")) == (stopped, shape)
    assert "Play" in seen.page.inner_text("#play")


def test_one_looks_inside_and_chooses_what_is_seen(run_of: RunOf, look: LookAt) -> None:
    run = run_of("heart")
    seen = look(_page(run))
    seen.go_to(6)
    whole = np.array(seen.trace(0, "x", "y", "z"))

    # The undeformed shape, which is cut at the middle of its extent along y, moves with the tissue.
    seen.page.select_option("#cut", "0")
    seen.settle()
    cut = np.array(seen.trace(0, "x", "y", "z"))
    assert cut.shape != whole.shape
    assert cut[1].min() > whole[1].min() + 10.0
    seen.page.fill("#depth", "4")
    seen.settle()
    assert np.array(seen.trace(0, "y")).min() > cut[1].min() + 5.0

    labels = seen.page.locator("#coloring option").all_inner_texts()
    assert labels == [
        "transmembrane potential (mV)",
        "active stress (kPa)",
        "fibre stretch (dimensionless)",
        "activation time (ms)",
    ]
    for number, label in enumerate(labels):
        seen.page.select_option("#coloring", str(number))
        seen.settle()
        bar = seen.page.evaluate("document.getElementById('heart').data[0].colorbar.title.text")
        assert bar == label
    assert seen.page.inner_text("#note").startswith("isochrones every ")

    seen.page.select_option("#cut", "-1")
    seen.settle()
    edges = len(seen.trace(1, "x")[0])
    seen.page.check("#fibers")
    seen.settle()
    assert len(seen.trace(1, "x")[0]) > edges + 300
    seen.page.check("#ghost")
    seen.settle()
    at_rest = run.points_mm
    assert at_rest is not None
    ghost = np.array(seen.trace(2, "x", "y", "z")).T.astype(np.float32)
    assert {tuple(row) for row in ghost} <= {tuple(row) for row in at_rest.astype(np.float32)}


def test_names_from_others_are_texts(run_of: RunOf, look: LookAt, tmp_path: Path) -> None:
    """An FMU that somebody made names columns and writes messages."""
    strange = "</script></title><script>stranger = 1</script><b>&amp;"
    folder = tmp_path / "strange"
    shutil.copytree(run_of("cell").folder, folder)
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    summary |= {"status": "failed", "name": strange, "message": strange, "warnings": [strange]}
    summary["request"] = {"file": strange, "settings": {strange: strange}}
    summary["scenario"][strange] = summary["versions"][strange] = strange
    (folder / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    for name in ("timeseries.csv", "coupling.csv"):
        head, rest = (folder / name).read_text(encoding="utf-8").split("\n", 1)
        renamed = head.replace("active_stress_mean_kPa", strange).replace("seconds_mechanics", f"seconds_{strange}")
        assert renamed != head
        (folder / name).write_text(f"{renamed}\n{rest}", encoding="utf-8")

    seen = look(write_page(folder))
    assert strange in seen.page.inner_text("h1")
    assert seen.page.evaluate("typeof window.stranger") == "undefined"
    for name in ("curves", "coupling"):
        assert "<script>stranger" in "".join(seen.page.locator(f"#{name} .annotation").all_text_contents())


def test_a_failed_run_says_so_first(run_of: RunOf, look: LookAt) -> None:
    run = run_of("failed")
    seen = look(_page(run))
    _check(run, seen)
    box = seen.page.locator(".failure")
    assert box.is_visible()
    assert run.summary["message"] in box.inner_text()
    top = box.bounding_box()
    assert top is not None
    assert top["y"] < 200.0


def test_residuals_of_every_sweep_are_shown(run_of: RunOf, look: LookAt) -> None:
    run = run_of("iterated")
    seen = look(_page(run), 375)
    _check(run, seen)
    figure = "document.getElementById('coupling')"
    titles = json.loads(seen.page.evaluate(f"JSON.stringify({figure}.layout.annotations.map((each) => each.text))"))
    (place,) = [number for number, title in enumerate(titles) if "residual of every sweep" in title]
    assert any("iterations of each step (count" in title for title in titles)
    drawn = seen.page.evaluate(
        f"{figure}._fullData.filter((trace) => trace.yaxis === 'y{place + 1 if place else ''}')"
        ".map((trace) => Array.from(trace.y).filter(Number.isFinite))"
    )
    log = run.numbers("iterations.csv")
    assert len(log["iteration"]) > 8
    assert drawn == [log["residual_mechanics.stretch"].tolist()]


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(path.stem for path in _SCENARIOS.glob("*.yaml")))
def test_reports_of_all_shipped_scenes_open_without_a_complaint(name: str, tmp_path: Path, look: LookAt) -> None:
    run = simulate(_SCENARIOS / f"{name}.yaml", {"run.participants": "native"}, tmp_path / name)
    for width in (1280, 375):
        _check(run, look(write_page(run.folder), width))
