"""Small scenarios to tune, and the command, in this process."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from cardiac_cosim.cli.app import main

#: Comments that have to survive, and a point whose activation takes a moment to come.
_STRAND = """\
# A short strand.
name: short
scene: {geometry: strand, mesh_size_mm: 2}
units:
  fibers: {unit: fiber_generator}
  electrophysiology:  # the wave
    unit: electrophysiology
    parameters: {time_scale_reduction: 0, stimulus_x_min_mm: -1, stimulus_x_max_mm: 8}
  active_stress: {unit: active_stress}
  mechanics: {unit: local_mechanics}
coupling: {step_ms: 1}  # held
run: {stop_ms: 20, participants: native}
output: {every_ms: 5, probes_mm: {near: [12, 0, 0]}}
"""


@dataclass(frozen=True)
class Ended:
    """How a call of the command ended."""

    code: int
    out: str
    err: str


@pytest.fixture
def strand(tmp_path: Path) -> Path:
    """The file of a scenario that runs in a moment."""
    path = tmp_path / "short.yaml"
    path.write_text(_STRAND)
    return path


@pytest.fixture
def cosim(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """The command, in this process: an exception that it does not expect is one of the test."""

    def call(*arguments: object) -> Ended:
        monkeypatch.setattr(sys, "argv", ["cosim", *map(str, arguments)])
        capsys.readouterr()
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        out, err = capsys.readouterr()
        return Ended(code, out, err)

    return call
