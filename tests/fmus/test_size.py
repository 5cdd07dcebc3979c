"""If these fail, a large mesh fills the memory of who builds an FMU or reads it, instead of being refused in time."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.cli import app as cli
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.fmus.description import size
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from fmpy.util import fmu_info
from typer.testing import CliRunner

_SCENE = """
name: large
scene: {geometry: strand, mesh_size_mm: 5}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology}
run: {stop_ms: 1, participants: PARTICIPANTS}
"""


def _scalars(mesh: Mesh) -> int:
    """Those of the FMI 2.0 mechanics: of its fields, and its other variables."""
    shapes = [variable.shape(mesh) for variable in UNITS["mechanics"].variables()]
    return sum(int(np.prod(shape)) for shape in shapes)


def test_more_scalars_than_readers_take_are_refused_before_anything_is_written(
    tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(size, "MOST_SCALARS", _scalars(tiny) - 1)
    with pytest.raises(InvalidInput, match=r"mechanics.* 3\.0 .*cosim build --fmi 3.*participants fmu3"):
        build_fmu(UNITS["mechanics"], tiny, tmp_path / "new" / "large.fmu")
    assert list(tmp_path.iterdir()) == []
    # In FMI 3.0 there is nothing to refuse, and as many as the limit are none too many.
    build_fmu(UNITS["mechanics"], tiny, tmp_path / "three.fmu", 3)
    monkeypatch.setattr(size, "MOST_SCALARS", _scalars(tiny))
    build_fmu(UNITS["mechanics"], tiny, tmp_path / "two.fmu")


def test_what_fmpy_tells_of_a_heart_is_read_in_a_moment(tiny: Mesh, tmp_path: Path) -> None:
    told = fmu_info(build_fmu(UNITS["mechanics"], tiny, tmp_path / "mechanics.fmu", 3))
    # A line for every variable that is exchanged, whatever the mesh; of 24 elements, 72 start values would be longer.
    assert len(told.splitlines()) < 60
    assert max(map(len, told.splitlines())) < 200


@pytest.mark.parametrize("command", ["run", "build"])
def test_the_command_says_what_is_too_large_and_what_helps(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(size, "MOST_SCALARS", 10)
    scenario = tmp_path / "large.yaml"
    scenario.write_text(_SCENE.replace("PARTICIPANTS", "fmu"))
    cache = ["--fmu-dir", str(tmp_path / "fmus")] if command == "run" else []
    result = CliRunner().invoke(cli.app, [command, str(scenario), "--output", str(tmp_path / "out"), *cache])
    # For which the command ends with exit code 2.
    assert isinstance(result.exception, InputError)
    assert re.search(r"large\.yaml: .* FMI 3\.0 .*--participants fmu3", str(result.exception))


def test_a_description_is_written_in_little_memory(tmp_path: Path) -> None:
    """Line by line: what is held at a time does not grow with the text."""
    text = """
import resource, sys
from pathlib import Path
from cardiac_cosim.fmus.archive import write_archive
line = "x" * 100
write_archive({"a": [line]}, Path(sys.argv[1]))
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
write_archive({"a": (line for _ in range(1_000_000))}, Path(sys.argv[1]))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""
    done = subprocess.run(
        [sys.executable, "-c", text, str(tmp_path / "a.zip")], capture_output=True, text=True, check=True, timeout=60
    )
    # In kB; the text has 100 MB.
    assert int(done.stdout) < 10_000
