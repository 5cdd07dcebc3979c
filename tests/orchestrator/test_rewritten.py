"""If these fail, a scenario that a program has changed loses what a person wrote in it, or does not run elsewhere."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.scenario import load_scenario, rewritten

_TEXT = """\
# What it is about.
name: 'two'
units:
  first: {fmu: fmus/mass.fmu, parameters: {k: 10, c: 0.2}}   # the first
  second:
    fmu: /absolute/mass.fmu
connections:
  - first.x -> second.x_in  # there
  - second.F -> first.F_in  # and back
inputs: {file: ../signals.csv}
coupling: {scheme: jacobi, step_ms: 10, iterate: {converge: {x: {relative: 1.0e-4}}}}
run: {stop_ms: 2000}
output: {every_ms: 2000}
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "scenarios" / "two.yaml"
    path.parent.mkdir()
    path.write_text(_TEXT)
    return path


def _written(file: Path, settings: Mapping[str, Any]) -> tuple[str, Path]:
    folder = file.parent.parent / "results" / "deep"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "two.yaml"
    path.write_text(rewritten(file, settings, folder))
    return path.read_text(), path


def test_comments_order_and_style_stay(file: Path) -> None:
    text, _ = _written(file, {"coupling.step_ms": 20.0})
    changed = _TEXT.replace("step_ms: 10", "step_ms: 20.0").replace("fmus/mass", "../../scenarios/fmus/mass")
    changed = changed.replace("../signals", "../../signals")
    assert text.splitlines()[0] == "# What it is about."
    assert [line.split() for line in text.splitlines()] == [line.split() for line in changed.splitlines()]


def test_paths_lead_to_the_same_files_from_the_new_folder(file: Path) -> None:
    _, path = _written(file, {})
    tuned = load_scenario(path)
    assert (path.parent / str(tuned.units["first"].fmu)).resolve() == file.parent / "fmus" / "mass.fmu"
    assert tuned.units["second"].fmu == "/absolute/mass.fmu"
    assert tuned.inputs is not None
    assert (path.parent / tuned.inputs.file).resolve() == file.parent.parent / "signals.csv"


def test_an_editor_finds_the_schema_from_the_new_folder(file: Path) -> None:
    line = "# yaml-language-server: $schema="
    for path, expected in (("schema/s.json", "../../scenarios/schema/s.json"), ("https://x.org/s", "https://x.org/s")):
        file.write_text(f"{line}{path}\n{_TEXT}")
        text, _ = _written(file, {})
        assert text.splitlines()[0] == f"{line}{expected}"


def test_settings_are_those_that_were_asked_for(file: Path) -> None:
    settings = {
        "coupling.iterate": None,
        "coupling.adaptive": {"tolerance": 0.05},
        "units.second.parameters.k": 3.5,
        "name": "two.tuned",
    }
    _, path = _written(file, settings)
    tuned = load_scenario(path)
    assert tuned.coupling.iterate is None
    assert tuned.coupling.adaptive is not None
    assert tuned.coupling.adaptive.tolerance == 0.05
    assert tuned.units["second"].parameters == {"k": 3.5}
    assert tuned.name == "two.tuned"


def test_what_changes_nothing_is_not_written(file: Path) -> None:
    text, _ = _written(file, {"coupling.interpolation": "hold", "coupling.scheme": "jacobi", "coupling.adaptive": None})
    assert "interpolation" not in text
    assert "adaptive" not in text


def test_a_section_that_stands_for_two_is_changed_in_one_place(file: Path) -> None:
    file.write_text(
        "name: two\nunits:\n  first: &mass {fmu: mass.fmu, parameters: {k: 1}}\n  second: *mass\nrun: {stop_ms: 5}\n"
    )
    _, path = _written(file, {"units.first.parameters.k": 2})
    tuned = load_scenario(path)
    assert tuned.units["first"].parameters == {"k": 2}
    assert tuned.units["second"].parameters == {"k": 1}


def test_a_mesh_in_place_of_a_geometry_leaves_no_geometry_in_the_text(tmp_path: Path) -> None:
    path = tmp_path / "scenarios" / "two.yaml"
    path.parent.mkdir()
    path.write_text("# A slab.\nname: a\nscene: {geometry: slab, mesh_size_mm: 3}\nunits: {m: {unit: mechanics}}\n")
    text, written = _written(path, {"scene.mesh": "own.msh"})
    assert text.splitlines()[0] == "# A slab."
    scene = load_scenario(written).scene
    assert scene is not None
    assert (scene.geometry, scene.mesh) == (None, "../../scenarios/own.msh")


def test_a_setting_that_is_not_valid_is_refused(file: Path) -> None:
    with pytest.raises(InputError, match="step"):
        rewritten(file, {"coupling.step_ms": 7.0}, file.parent)
