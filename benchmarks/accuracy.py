"""The heartbeat against the reference's, on the reference's mesh: writes the table in README.md (half a minute)."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

from .page import README, write_between

_ROOT = Path(__file__).parent.parent
_DATA = _ROOT / "tests" / "data"
#: Activation of the reference at the probes in ms; source: tests/data/README.md.
_ACTIVATION = {"base": 4.91, "middle": 68.52, "apex": 102.83}


def measure() -> str:
    """The table: reference, ours, largest difference."""
    scenario = load_scenario(
        _ROOT / "scenarios" / "baseline.yaml", ["scene={mesh: reference_5mm.msh}", "run.participants=native"]
    )
    with TemporaryDirectory() as folder:
        summary = run_scenario(scenario, _DATA, Path(folder)).summary
        found = np.genfromtxt(Path(folder) / "timeseries.csv", delimiter=",", names=True)
    expected = np.genfromtxt(_DATA / "reference_5mm.csv", delimiter=",", names=True)
    at = np.searchsorted(found["time_ms"], expected["time_ms"])
    rows = ["| | reference | here | |", "|---|---|---|---|"]
    for probe, time in _ACTIVATION.items():
        ours = summary["activation_time_ms"][probe]
        rows.append(f"| activation, {probe} | {time:.1f} ms | {ours:.1f} ms | {ours - time:+.1f} ms |")
    for column, label, unit in (
        ("lv_volume_ml", "left ventricle, smallest volume", "ml"),
        ("rv_volume_ml", "right ventricle, smallest volume", "ml"),
        ("apex_uplift_mm", "apex uplift, largest", "mm"),
    ):
        pick = np.max if unit == "mm" else np.min
        worst = np.abs(found[column][at] - expected[column]).max()
        rows.append(
            f"| {label} | {pick(expected[column]):.2f} {unit} | {pick(found[column][at]):.2f} {unit} "
            f"| at most {worst:.2f} {unit} apart at any time |"
        )
    return "\n".join(rows)


if __name__ == "__main__":
    write_between(README, "accuracy", measure())
