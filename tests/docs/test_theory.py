"""If these fail, the page on theory teaches a student something that the master does not do."""

import importlib
import re
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.orchestrator.simulation import simulate
from oscillator import Oscillator

_DOCS = Path(__file__).parents[2] / "docs"

#: Two delays that feed each other, as `held_inputs` has them; either starts where the growing solution is not.
_RING = """
name: ring
scene: {{geometry: cell}}
units:
  a: {{unit: response, parameters: {{gain: {gain}, delay_rate_per_ms: {rate}, disturbance: 1}}}}
  b: {{unit: response, parameters: {{gain: {gain}, delay_rate_per_ms: {rate}}}}}
connections: [a.y -> b.u, b.y -> a.u]
run: {{participants: native, checkpoint_every: 0}}
"""
#: The two masses of the literature, m = 1, k = 10, 20, k_c = 10, c = 0.2, 0.3, c_c = 0.5; FD cuts the coupling at the
#: force, DD at the displacements on either side.
_MASSES = """
name: masses
scene: {geometry: cell}
units:
  first: {unit: mass, parameters: {k: 10, c: 0.2, x_start: 1%s}}
  second: {unit: mass, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5, x_start: 0.5}}
connections: [first.x -> second.x_in, first.v -> second.v_in, %s]
coupling: {step_ms: 10}
run: {participants: native, checkpoint_every: 0, stop_ms: 2000}
output: {every_ms: 2000}
"""
_SPLITS = {
    "FD": _MASSES % ("", "second.F -> first.F_in"),
    "DD": _MASSES % (", k_c: 10, c_c: 0.5", "second.x -> first.x_in, second.v -> first.v_in"),
}


def _iterate(*fields: str) -> dict[str, Any]:
    converge = {field: {"absolute": 1e-13, "relative": 1e-13} for field in fields}
    return {"coupling.iterate": {"acceleration": "anderson", "max_iterations": 100, "converge": converge}}


_LINEAR = {"coupling.interpolation": "linear", "coupling.extrapolation": 1}


@pytest.fixture
def pictures(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The script of that name in docs/pictures."""
    monkeypatch.syspath_prepend(str(_DOCS / "pictures"))

    def script(name: str) -> ModuleType:
        return importlib.import_module(name)

    return script


def _factors(file: Path, settings: dict[str, Any], step_ms: float, steps: int, folder: Path) -> np.ndarray:
    """What the outputs of both units were multiplied by in the last step of a run."""
    times = {"coupling.step_ms": step_ms, "run.stop_ms": step_ms * steps, "output.every_ms": step_ms * steps}
    columns = simulate(file, settings | times, folder).columns
    last = np.array([columns[name][-2:] for name in columns if name.endswith("y")])
    return last[:, 1] / last[:, 0]


@pytest.mark.parametrize("step_ms", [1.0, 4.0])
@pytest.mark.parametrize(
    ("scheme", "settings"),
    [
        ("jacobi", {"coupling.scheme": "jacobi"}),
        ("gauss_seidel", {}),
        ("iterated", _iterate("b.y")),
        ("iterated_linear", _iterate("b.y") | _LINEAR),
    ],
)
def test_a_loop_of_delays_grows_as_the_closed_form_says(
    scheme: str, settings: dict[str, Any], step_ms: float, pictures: Any, tmp_path: Path
) -> None:
    held = pictures("held_inputs")
    file = tmp_path / "ring.yaml"
    file.write_text(_RING.format(gain=held.GAIN, rate=held.RATE))
    found = _factors(file, settings, step_ms, round(150.0 / step_ms), tmp_path / "run")
    np.testing.assert_allclose(found, getattr(held, scheme)(step_ms), rtol=1e-9)
    assert np.log(found[0]) / step_ms != pytest.approx(held.EXACT, rel=1e-6)


def test_held_inputs_cost_half_a_step_each_and_gauss_seidel_has_both_signs(pictures: Any) -> None:
    held = pictures("held_inputs")
    # The law of the page: to first order the rate is off by ½ H ε √g, with the sign of the inputs' time.
    first = 0.5 * held.RATE * held.GAIN
    for step in (1e-3, 1e-4):
        for scheme, sign in ((held.jacobi, -1.0), (held.iterated, 1.0)):
            assert held.growth_error(scheme(step), step) / step == pytest.approx(sign * first, rel=2e-3)
    for scheme in (held.gauss_seidel, held.iterated_linear):
        coarse, fine = (held.growth_error(scheme(step), step) for step in (1.0, 0.5))
        assert coarse / fine == pytest.approx(4.0, rel=0.02)
    # What the page says in numbers.
    text = (_DOCS / "theory.md").read_text(encoding="utf-8").replace("−", "-")
    for scheme in (held.jacobi, held.gauss_seidel, held.iterated, held.iterated_linear):
        for step in (1.0, 0.5):
            assert f"{100.0 * held.growth_error(scheme(step), step):+.2f} %" in text


@pytest.mark.parametrize("split", _SPLITS)
def test_on_two_masses_iterating_held_inputs_helps_or_harms_as_the_page_says(split: str, tmp_path: Path) -> None:
    file = tmp_path / "masses.yaml"
    file.write_text(_SPLITS[split])
    exact = Oscillator().exact(2.0)
    fields = ("second.F",) if split == "FD" else ("second.x", "second.v")
    cells = []
    for number, settings in enumerate(({}, _iterate(*fields), _LINEAR, _iterate(*fields) | _LINEAR)):
        columns = simulate(file, settings, tmp_path / str(number)).columns
        found = [columns[name][-1] for name in ("first.x", "first.v", "second.x", "second.v")]
        cells.append(f"{np.abs(np.array(found) - exact).max():.4f}")
    text = (_DOCS / "theory.md").read_text(encoding="utf-8")
    assert f"| {' | '.join(cells)} |" in text


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("side", [0.98, 1.02])
def test_extrapolation_lowers_the_gain_that_an_explicit_loop_bears(
    order: int, side: float, pictures: Any, tmp_path: Path
) -> None:
    loop = pictures("extrapolated_loop")
    gain = side * loop.limit(order)
    assert loop.limit(order) == pytest.approx((-1.0, -1.0 / 3.0, -1.0 / 7.0)[order])
    settings = {"units.back.parameters.gain": gain, "coupling.extrapolation": order}
    feedback = _DOCS.parent / "scenarios" / "feedback.yaml"
    found = _factors(feedback, {**settings, "run.participants": "native"}, 1.0, 80, tmp_path)
    np.testing.assert_allclose(found, -loop.growth(gain, order), rtol=1e-6)
    assert (np.abs(found) > 1.0).all() == (side > 1.0)


def test_a_positive_gain_is_borne_up_to_one_but_by_parabolas_up_to_a_half(pictures: Any) -> None:
    loop = pictures("extrapolated_loop")
    for order, limit in ((0, 1.0), (1, 1.0), (2, 0.5)):
        assert loop.growth(limit - 1e-3, order) < 1.0 < loop.growth(limit + 1e-3, order)


def test_the_pictures_of_the_pages_are_those_that_the_scripts_draw(pictures: Any, tmp_path: Path) -> None:
    drawn = {pictures(name).draw(tmp_path).name for name in ("architecture", "extrapolated_loop", "held_inputs")}
    timing = pictures("timing_diagrams")
    drawn |= {draw(tmp_path).name for draw in (timing.held, timing.linear, timing.iterated)}
    pages = "".join((_DOCS / f"{page}.md").read_text(encoding="utf-8") for page in ("theory", "architecture"))
    # The one of the heart takes a minute, and comes with a table.
    assert set(re.findall(r"images/theory/(\w+\.svg)", pages)) == drawn | {"signed_errors.svg"}
    assert {file.name for file in (_DOCS / "images" / "theory").iterdir()} == drawn | {"signed_errors.svg"}
