"""If this failed, the page on a unit of one's own would show a windkessel that is none, or numbers that are not so."""

import importlib
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.orchestrator.simulation import simulate
from cardiac_cosim.units.registry import UNITS
from doc_blocks import ROOT, blocks

_PAGE = ROOT / "docs" / "own_unit.md"
_RESISTANCE, _COMPLIANCE, _IMPEDANCE = 0.13, 8.0, 0.007


def test_the_unit_has_fewer_lines_than_the_title_says() -> None:
    (unit,) = (block for block in blocks(_PAGE) if block.saved_as == "windkessel.py")
    assert len(unit.text.splitlines()) <= 50


def test_the_ventricle_empties_as_the_page_tells(project: Path) -> None:
    for block in blocks(_PAGE):
        if block.saved_as is not None:
            (project / block.saved_as).write_text(block.text, encoding="utf-8")
    UNITS["windkessel"] = importlib.import_module("windkessel").Windkessel
    arteries = {"unit": "windkessel", "parameters": {"compliance": _COMPLIANCE}}
    run = simulate("ejection.yaml", {"units.arteries": arteries, "run.participants": "native"}, output="results")
    volume, pressure = run.columns["lv_volume_ml"], run.columns["lv_pressure_kPa"]
    assert f"from {volume[0]:.0f} ml to {volume.min():.0f} ml" in _PAGE.read_text(encoding="utf-8")
    assert f"rises to {pressure.max():.1f} kPa" in _PAGE.read_text(encoding="utf-8")
    # What has left the ventricle is in the arteries or has passed the resistance; the flow is constant in each step.
    step_s = np.diff(run.columns["time_ms"]) / 1000.0
    arterial = pressure[1:] + _IMPEDANCE * np.diff(volume) / step_s
    passed = np.sum(0.5 * (arterial + np.insert(arterial[:-1], 0, 0.0)) * step_s) / _RESISTANCE
    assert volume[0] - volume[-1] == pytest.approx(_COMPLIANCE * arterial[-1] + passed, rel=1e-3)
