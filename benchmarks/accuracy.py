"""The heartbeat compared with that of the reference, on its mesh: writes the table in README.md (half a minute)."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from cardiac_cosim.orchestrator.simulation import simulate

from .page import README, write_between

_ROOT = Path(__file__).parent.parent
_DATA = _ROOT / "tests" / "data"
#: Activation of the reference at the probes in ms; source: tests/data/README.md.
_ACTIVATION = {"base": 4.91, "middle": 68.52, "apex": 102.83}


def measure() -> str:
    """The table: reference, ours, largest difference."""
    settings = {"scene": {"mesh": str(_DATA / "reference_5mm.msh")}, "run.participants": "native"}
    with TemporaryDirectory() as folder:
        run = simulate(_ROOT / "scenarios" / "baseline.yaml", settings, folder)
        found, activation = run.columns, run.summary["activation_time_ms"]
    expected = np.genfromtxt(_DATA / "reference_5mm.csv", delimiter=",", names=True)
    at = np.searchsorted(found["time_ms"], expected["time_ms"])
    rows = ["| | reference | here | |", "|---|---|---|---|"]
    for probe, time in _ACTIVATION.items():
        ours = activation[probe]
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
