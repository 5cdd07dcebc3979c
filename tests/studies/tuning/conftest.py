"""A small scenario to tune."""

from pathlib import Path

import pytest

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


@pytest.fixture
def strand(tmp_path: Path) -> Path:
    """The file of a scenario that runs in a moment."""
    path = tmp_path / "short.yaml"
    path.write_text(_STRAND)
    return path
