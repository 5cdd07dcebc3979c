"""If these fail, a map that ships shows a boundary where the methods hold, or hides one where they fail."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.plan import load_study
from cardiac_cosim.studies.stability import Cell, StabilityMap, map_study, plan_map
from cardiac_cosim.studies.stability.limit import Limit
from cardiac_cosim.studies.stability.map import DIVERGED, INACCURATE, OSCILLATING, SOUND, UNIT_FAILED
from cardiac_cosim.studies.stability.predicted import Predictor
from cardiac_cosim.studies.study import Line, Study
from cardiac_cosim.units.mesh.archive import unpack_mesh
from cardiac_cosim.units.mesh.quality import signed_inverse_condition_number
from slivers import QUALITIES, sliver_file, sliver_mesh

_SCENARIOS = Path(__file__).parents[3] / "scenarios"
_STUDIES = {path.stem: path for path in sorted((_SCENARIOS / "stability").glob("*.yaml"))}

#: How far beside a predicted limit runs are, relative to it, and how exactly growth is as predicted.
_BESIDE, _AGREES = 0.03, 0.02


class Cells(dict[tuple[str, Any], Cell]):
    """The cells of a map by line and by the value of y."""

    def __init__(self, found: StabilityMap) -> None:
        super().__init__({(panel.name, cell.y): cell for panel in found.panels for cell in panel.cells})
        self.panels = {panel.name: panel for panel in found.panels}


@dataclass(frozen=True)
class Boundary:
    """A line of a study at one `x`: beyond its predicted limit runs are of the class `outside`, and say `words`.

    `remedies` are lines that are sound there. Where the stable side is that of large values, it is `above`. `grows`
    says whether the growth that is measured outside is the predicted one. `shorter` are keys of the study that are
    others here because its own take long, and `assignments` are other parameters than it has.
    """

    study: str
    x: Any
    line: str
    outside: str
    words: str = ""
    remedies: Sequence[str] = ()
    above: bool = False
    grows: bool = False
    shorter: Mapping[str, Any] = field(default_factory=dict)
    assignments: Sequence[str] = ()

    def __str__(self) -> str:
        return " ".join([self.study, self.line, *self.assignments])


_GROWS = "grows by a factor of"
_LEAVES = "failed in the step"

_BOUNDARIES = [
    Boundary(
        *("loop_gain", 5, "explicit Gauss–Seidel", OSCILLATING, _GROWS),
        remedies=["explicit Gauss–Seidel, stabilised", "iterated Gauss–Seidel"],
        grows=True,
    ),
    Boundary("delay", 1, "explicit Gauss–Seidel", OSCILLATING, _GROWS, remedies=["iterated"], grows=True),
    Boundary("stretch_rate", 1, "explicit Gauss–Seidel", OSCILLATING, _GROWS, ["iterated"], above=True, grows=True),
    *(
        Boundary("oscillator", 20, line, outside, _GROWS, remedies, grows=True)
        for line, outside, remedies in (
            ("Jacobi, held", DIVERGED, ["Jacobi, linear"]),
            ("Gauss–Seidel, held", DIVERGED, ["Jacobi, linear", "Gauss–Seidel, linear"]),
            ("Jacobi, linear", DIVERGED, []),
            ("Gauss–Seidel, linear", OSCILLATING, []),
        )
    ),
    Boundary(
        *("oscillator", 20, "Gauss–Seidel, held", DIVERGED, _GROWS),
        grows=True,
        assignments=["units.second.parameters.k=55", "units.first.parameters.m=1.7"],
    ),
    Boundary("reaction_step", 12.9, "explicit reaction", INACCURATE, "the error in potential_cell_mV is"),
    Boundary("active_stress_step", 1, "forward Euler", DIVERGED, _GROWS, ["exact"], grows=True),
    Boundary("explicit_diffusion", 1, "explicit, consistent mass", UNIT_FAILED, _LEAVES, ["implicit"]),
]

#: The same, which take longer in all than every run of the tests may.
_LONG = [
    Boundary("loop_gain", 10, "explicit Jacobi", DIVERGED, _GROWS, grows=True),
    Boundary(
        *("loop_gain", 5, "explicit Gauss–Seidel", OSCILLATING, _GROWS),
        remedies=["explicit Gauss–Seidel, stabilised"],
        grows=True,
        assignments=["units.active_stress.parameters.tension_per_potential_MPa_per_mV=0.004"],
    ),
    Boundary("delay", 0.5, "explicit Jacobi", OSCILLATING, _GROWS, grows=True),
    Boundary("resting_tissue", 10, "one cell at rest", INACCURATE, "the error in potential_cell_mV is"),
    Boundary("explicit_diffusion", 1, "explicit, lumped mass", UNIT_FAILED, _LEAVES),
    # Each look at this theory takes a third of a second: one search for the limit is enough.
    *(
        Boundary("coarse_meshes", 7.5, line, INACCURATE, "is never activated", shorter={"theory": None})
        for line in ("consistent mass, current at the nodes", "lumped mass")
    ),
    Boundary(
        *("slivers", "stability/meshes/slab_sicn_0.01.npz", "explicit, consistent mass", UNIT_FAILED, _LEAVES),
        remedies=["implicit"],
    ),
    Boundary(
        *("heart_loop_gain", 4, "explicit Gauss–Seidel", OSCILLATING, _GROWS),
        remedies=["explicit Gauss–Seidel, stabilised", "iterated Gauss–Seidel"],
    ),
]


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """One for all studies; what runs cost is not looked at."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("cardiac_cosim.studies.bench._REPEATS_S", 0.0)
        with Bench(tmp_path_factory.mktemp("shipped")) as bench:
            yield bench


@pytest.fixture
def run(tmp_path: Path, bench: Bench) -> Callable[..., Cells]:
    """Runs some lines of a shipped study at one x and other y; `changed` are keys of the study itself."""

    def cells(
        name: str, x: Any, ys: Mapping[str, Sequence[Any]], assignments: Sequence[str] = (), **changed: Any
    ) -> Cells:
        study = load_study(_STUDIES[name])
        lines = [
            line.model_copy(update={"vary": dict(zip(line.vary, ([x], list(ys[line.name])), strict=True))})
            for line in study.lines
            if line.name in ys
        ]
        path = _written(study, lines, tmp_path / f"{name}.yaml", changed)
        found = map_study(plan_map(path, assignments), bench)
        return Cells(found)

    return cells


def _written(study: Study, lines: Sequence[Line], path: Path, changed: Mapping[str, Any]) -> Path:
    """A file of the study with these lines only, without bisection, and with `changed` on top. JSON is YAML."""
    update = {"scenario": str(_STUDIES["loop_gain"].parent / study.scenario), "lines": list(lines), "bisect": 0}
    path.write_text(study.model_copy(update=update | dict(changed)).model_dump_json(exclude_none=True))
    return path


def _predicted_limit(boundary: Boundary) -> float:
    """Where theory has the limit of a line, of the values that its study looks at; the outermost on its stable side."""
    plan = plan_map(_STUDIES[boundary.study], boundary.assignments)
    (grid,) = (grid for grid in plan.grids if grid.line.name == boundary.line)
    assert plan.theory is not None
    predictor = Predictor(plan.theory, plan.base, plan.origin)
    # Between two values of the study it is found to a thousandth of their distance.
    limit = Limit(grid.x, grid.y, lambda x, y: predictor.amplification(plan.scenario(grid, x, y)), costly=True).at(
        boundary.x
    )
    assert limit, f"{boundary}: no limit on the map"
    return limit[-1] if boundary.above else min(limit, key=abs)


# --- all files --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", _STUDIES)
def test_a_shipped_study_can_be_run_and_says_what_it_teaches(name: str) -> None:
    path = _STUDIES[name]
    # All points are checked, and that there is such a theory.
    plan = plan_map(path)
    assert (plan.theory is None) == (plan.study.theory is None)
    header = path.read_text().split("\nname:", 1)[0]
    assert all(line.startswith("#") for line in header.splitlines())
    assert "What one learns: " in header
    # Results go to results/<name>, and those of a scenario of the same name do too.
    assert plan.study.name == (f"{name}_stability" if (_SCENARIOS / f"{name}.yaml").exists() else name)


@pytest.mark.parametrize("quality", QUALITIES)
def test_the_meshes_with_slivers_are_what_their_script_makes(quality: float) -> None:
    mesh, stored = sliver_mesh(quality), unpack_mesh(sliver_file(quality))
    qualities = np.sort(signed_inverse_condition_number(stored))
    assert qualities[0] == pytest.approx(quality, rel=1e-6)
    # All else is as sound as it was, but for the one in the same plane and those around the node.
    assert qualities[1] > quality
    assert qualities[2] > 0.2
    np.testing.assert_allclose(stored.points, mesh.points, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(stored.cells, mesh.cells)
    assert stored.boundaries.keys() == mesh.boundaries.keys()
    for name, faces in mesh.boundaries.items():
        np.testing.assert_array_equal(stored.boundaries[name], faces)


# --- studies with a theory --------------------------------------------------------------------------------------------


def _check(boundary: Boundary, run: Callable[..., Cells]) -> None:
    limit = _predicted_limit(boundary)
    stable, unstable = (1.0 + _BESIDE, 1.0 - _BESIDE) if boundary.above else (1.0 - _BESIDE, 1.0 + _BESIDE)
    # As studies write their values, and with steps that are the same in every digit.
    inside, outside = (float(f"{factor * limit:.6g}") for factor in (stable, unstable))
    ys = {boundary.line: [inside, outside]} | {line: [outside] for line in boundary.remedies}
    cells = run(boundary.study, boundary.x, ys, boundary.assignments, **dict(boundary.shorter))
    sound, failed = cells[boundary.line, inside], cells[boundary.line, outside]
    assert (sound.kind, sound.reason) == (SOUND, "")
    assert failed.kind == boundary.outside, failed
    assert boundary.words in failed.reason
    if "theory" not in boundary.shorter:
        assert sound.predicted is not None
        assert failed.predicted is not None
        assert sound.predicted < 1.0 < failed.predicted
        (crossing,) = cells.panels[boundary.line].crossings
        assert crossing.predicted == pytest.approx(limit, rel=_AGREES)
    if boundary.grows:
        assert failed.measure == pytest.approx(failed.predicted, rel=_AGREES)
    for line in boundary.remedies:
        assert cells[line, outside].kind == SOUND, cells[line, outside].reason


@pytest.mark.parametrize("boundary", _BOUNDARIES, ids=str)
def test_inside_the_predicted_boundary_it_holds_and_outside_it_fails(
    boundary: Boundary, run: Callable[..., Cells]
) -> None:
    _check(boundary, run)


@pytest.mark.long
@pytest.mark.parametrize("boundary", _LONG, ids=str)
def test_inside_it_holds_and_outside_it_fails_on_the_others_and_on_the_heart(
    boundary: Boundary, run: Callable[..., Cells]
) -> None:
    _check(boundary, run)


# --- studies without one ----------------------------------------------------------------------------------------------


def test_what_is_printed_wrongly_must_fail_and_says_whose_reading_it_is(run: Callable[..., Cells]) -> None:
    coarse = ["scene.mesh_size_mm=6", "run.stop_ms=16"]
    signs = {"a piece of wall": ["stress_free", "as_printed"]}
    right = run("as_printed", "gompertz", signs, coarse)
    printed = run("as_printed", "as_printed", signs, coarse)
    assert right["a piece of wall", "stress_free"].kind == SOUND
    stressed = right["a piece of wall", "as_printed"], printed["a piece of wall", "as_printed"]
    runs_away = printed["a piece of wall", "stress_free"]
    for cell in (*stressed, runs_away):
        assert cell.kind == UNIT_FAILED
        assert cell.trial is not None
        assert "as printed in the source document" in cell.trial.reason
    assert all("the undeformed tissue carries a stress" in cell.reason for cell in stressed)
    assert "the delay function gives the rate -" in runs_away.reason


@pytest.mark.parametrize(("step_ms", "tension"), [(4, 0.02), (40, 0.005)])
def test_full_newton_steps_fail_where_those_with_safeguards_do_not(
    step_ms: float, tension: float, run: Callable[..., Cells]
) -> None:
    ys = {"full Newton steps": [tension / 4, tension], "with safeguards": [tension]}
    cells = run("newton", step_ms, ys, ["scene.mesh_size_mm=6", "run.stop_ms=40"])
    assert cells["full Newton steps", tension / 4].kind == SOUND
    failed = cells["full Newton steps", tension]
    assert failed.kind == UNIT_FAILED
    assert "unit 'mechanics' failed" in failed.reason
    assert "the tangent stiffness is not positive definite" in failed.reason
    assert cells["with safeguards", tension].kind == SOUND


def test_a_sliver_makes_full_newton_steps_fail_on_the_tension_that_the_tissue_has(run: Callable[..., Cells]) -> None:
    tension = {"full Newton steps": [0.005], "with safeguards": [0.005]}
    kinds = {
        (quality, name): cell.kind
        for quality in ("0.3", "0.001")
        for (name, _), cell in run("slivers_newton", f"stability/meshes/slab_sicn_{quality}.npz", tension).items()
    }
    assert kinds == {
        ("0.3", "full Newton steps"): SOUND,
        ("0.3", "with safeguards"): SOUND,
        ("0.001", "full Newton steps"): UNIT_FAILED,
        ("0.001", "with safeguards"): SOUND,
    }


def test_elements_that_are_long_against_the_front_shift_the_activation(run: Callable[..., Cells]) -> None:
    consistent, quadrature, lumped = (line.name for line in load_study(_STUDIES["front_speed"]).lines)
    diffusion = {consistent: [1], quadrature: [1], lumped: [0.1, 1]}
    fine, coarse = run("front_speed", 0.5, diffusion), run("front_speed", 10, diffusion)
    assert all(cell.kind == SOUND for (_, y), cell in fine.items() if y == 1)
    # The lumped mass makes slow what half an element of stimulus has made early.
    assert coarse.pop((lumped, 1)).kind == SOUND
    assert [cell.kind for cell in coarse.values()] == [INACCURATE] * 3
    assert all("the error in activation_ms is" in cell.reason for cell in coarse.values())


@pytest.mark.long
def test_a_loose_equilibrium_moves_the_activation(run: Callable[..., Cells]) -> None:
    conductance = {"Gauss–Seidel, linear": [1000]}
    (tight,) = run("loose_equilibrium", 1e-6, conductance).values()
    (loose,) = run("loose_equilibrium", 9e-3, conductance).values()
    assert (tight.kind, loose.kind) == (SOUND, INACCURATE)
    assert tight.errors["activation_ms"] < 1e-3
    assert "the error in activation_ms is" in loose.reason


@pytest.mark.long
def test_a_strong_current_fires_tissue_too_soon_where_steps_are_long(run: Callable[..., Cells]) -> None:
    strong = 1000
    shorter = ["run.stop_ms=80"]
    held = {"Gauss–Seidel, held": [10, strong]}
    short, long = run("stretch_current", 1, held, shorter), run("stretch_current", 20, held, shorter)
    adaptive = run("stretch_current", 0.05, {"adaptive": [strong]}, shorter)
    late, early = short["Gauss–Seidel, held", strong], long["Gauss–Seidel, held", strong]
    assert (late.kind, early.kind, adaptive["adaptive", strong].kind) == (SOUND, INACCURATE, SOUND)
    assert early.errors["activation_ms"] > 20.0
    # A false beat, and no late one.
    assert _apex_ms(early) < _apex_ms(adaptive["adaptive", strong]) - 20.0


def _apex_ms(cell: Cell) -> float:
    assert cell.trial is not None
    return float(cell.trial.run.summary["activation_time_ms"]["apex"])
