"""If these fail, a heart through FMUs beats otherwise than by direct calls, or does not go on where it was stopped."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cardiac_cosim.cli import app as cli
from cardiac_cosim.orchestrator.errors import InputError, ParticipantError, RunError
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from typer.testing import CliRunner

_DATA = Path(__file__).parents[2] / "data"

_HEART = f"""\
name: small
scene: {{mesh: {_DATA / "biventricle_12mm.msh"}}}
units:
  fibers: {{unit: fiber_generator}}
  electrophysiology: {{unit: electrophysiology, parameters: {{stimulus_depth_mm: 2}}}}
  active_stress: {{unit: active_stress}}
  mechanics: {{unit: mechanics}}
run: {{stop_ms: 10}}
output: {{probes_mm: {{base: [25, 0, -1]}}}}
"""

_SCHEMES = {
    "explicit": (),
    "parallel": ("coupling.scheme=jacobi", "coupling.interpolation=linear", "coupling.extrapolation=1"),
    "iterated": (
        "coupling.step_ms=5",
        "coupling.iterate={acceleration: anderson, converge: {stretch: {relative: 1e-4}}}",
    ),
    "adaptive": ("coupling.adaptive={tolerance: 0.1}",),
}


@pytest.mark.parametrize("scheme", _SCHEMES)
def test_a_heart_through_fmus_beats_as_by_direct_calls(scheme: str, tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    series = {}
    for participants in ("native", "fmu", "fmu3"):
        sets = (*_SCHEMES[scheme], f"run.participants={participants}")
        scenario = load_scenario(tmp_path / "heart.yaml", sets)
        run_scenario(scenario, tmp_path, tmp_path / participants, fmu_dir=tmp_path / "fmus")
        series[participants] = (tmp_path / participants / "timeseries.csv").read_text()
    assert series["fmu"] == series["fmu3"] == series["native"]
    assert len(series["fmu3"].splitlines()) > 2


@pytest.mark.parametrize("participants", ["fmu", "fmu3"])
def test_an_interrupted_run_goes_on_to_the_same_end(
    participants: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    sets = [f"run.participants={participants}", "run.checkpoint_every=4"]
    scenario = load_scenario(tmp_path / "heart.yaml", sets)
    run_scenario(scenario, tmp_path, tmp_path / "whole", fmu_dir=tmp_path / "fmus")
    step = FmuParticipant.start

    def failing(self: FmuParticipant, time: float, size: float) -> Any:
        if time > 0.0065:
            raise ParticipantError("pulled the plug")
        return step(self, time, size)

    with monkeypatch.context() as patch:
        patch.setattr(FmuParticipant, "start", failing)
        with pytest.raises(RunError, match="pulled the plug"):
            run_scenario(scenario, tmp_path, tmp_path / "parts", fmu_dir=tmp_path / "fmus")
    assert json.loads((tmp_path / "parts" / "summary.json").read_text())["resumable"] is True
    run_scenario(scenario, tmp_path, tmp_path / "parts", fmu_dir=tmp_path / "fmus", resume=True)
    assert (tmp_path / "parts" / "timeseries.csv").read_text() == (tmp_path / "whole" / "timeseries.csv").read_text()


def test_what_cosim_build_makes_takes_a_units_place(fmi: int, tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    built = CliRunner().invoke(
        cli.app, ["build", str(tmp_path / "heart.yaml"), "--fmi", str(fmi), "--output", str(tmp_path / "built")]
    )
    assert built.exit_code == 0, built.output
    names = ["fiber_generator", "electrophysiology", "active_stress", "mechanics"]
    assert sorted(path.name for path in (tmp_path / "built").iterdir()) == sorted(f"{name}.fmu" for name in names)
    text = _HEART
    for name in names:
        text = text.replace(f"unit: {name}", f"fmu: built/{name}.fmu")
    assert "unit:" not in text
    (tmp_path / "fmus.yaml").write_text(text)
    for name, sets in (("heart", ["run.participants=native"]), ("fmus", [])):
        run_scenario(load_scenario(tmp_path / f"{name}.yaml", sets), tmp_path, tmp_path / name)
    assert (tmp_path / "fmus" / "timeseries.csv").read_text().count("\n") == 12
    heart, fmus = (np.genfromtxt(tmp_path / name / "timeseries.csv", delimiter=",") for name in ("heart", "fmus"))
    np.testing.assert_array_equal(heart[1:], fmus[1:])


def test_files_for_libcosim_and_containers_are_of_fmi_2_only(tmp_path: Path) -> None:
    (tmp_path / "heart.yaml").write_text(_HEART)
    for option in ("--osp", "--container"):
        arguments = ["build", str(tmp_path / "heart.yaml"), "--fmi", "3", option, "--output", str(tmp_path / "out")]
        result = CliRunner().invoke(cli.app, arguments)
        assert isinstance(result.exception, InputError)
        assert "are for FMUs of FMI 2.0" in str(result.exception)
    assert not (tmp_path / "out").exists()
