"""What a coupling costs and errs by against explicit 0.1 ms: the table in docs/coupling.md (eight minutes)."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

from .page import write_between

_ROOT = Path(__file__).parent.parent
_PAGE = _ROOT / "docs" / "coupling.md"
_ITERATE = "coupling.iterate={acceleration: anderson, converge: {stretch: {relative: 1e-5}}}"
_LINEAR = ("coupling.interpolation=linear", "coupling.extrapolation=1")
_CASES: dict[str, tuple[str, ...]] = {
    "Gauss–Seidel, held, 1 ms": ("coupling.step_ms=1",),
    "Gauss–Seidel, held, 5 ms": ("coupling.step_ms=5",),
    "Jacobi, held, 5 ms": ("coupling.scheme=jacobi", "coupling.step_ms=5"),
    "iterated, held, 5 ms": (_ITERATE, "coupling.step_ms=5"),
    **{
        f"iterated, linear, {step:g} ms": (_ITERATE, *_LINEAR, f"coupling.step_ms={step}")
        for step in (10, 5, 2.5, 1.25)
    },
    "Gauss–Seidel, linear, 5 ms": (*_LINEAR, "coupling.step_ms=5"),
    "Jacobi, linear, 5 ms": ("coupling.scheme=jacobi", *_LINEAR, "coupling.step_ms=5"),
    "adaptive, default tolerance": ("coupling.adaptive={}",),
    "adaptive, tolerance 0.02": ("coupling.adaptive={tolerance: 0.02}",),
}


def _run(folder: Path, *sets: str) -> tuple[np.ndarray, np.ndarray]:
    common = ["run.participants=native", "run.checkpoint_every=0", "output.every_ms=20"]
    run_scenario(load_scenario(_ROOT / "scenarios" / "baseline.yaml", [*common, *sets]), _ROOT / "scenarios", folder)
    return (
        np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True),
        np.genfromtxt(folder / "coupling.csv", delimiter=",", names=True),
    )


def measure() -> str:
    """The table: coupling, solves of each unit in the loop with those of refused steps, largest error in ml."""
    rows = ["| coupling | steps | solves | LV volume, largest error | at 60 ms |", "|---|---|---|---|---|"]
    with TemporaryDirectory() as folder:
        finest, _ = _run(Path(folder), "coupling.step_ms=0.1")
        for name, sets in _CASES.items():
            series, log = _run(Path(folder), *sets)
            error = series["lv_volume_ml"] - np.interp(series["time_ms"], finest["time_ms"], finest["lv_volume_ml"])
            middle = float(np.interp(60.0, series["time_ms"], error))
            solves = int(log["iterations"].sum() + log["rejected"].sum())
            rows.append(f"| {name} | {len(log)} | {solves} | {np.abs(error).max():.3f} ml | {middle:+.3f} ml |")
    return "\n".join(rows)


if __name__ == "__main__":
    write_between(_PAGE, "coupling", measure())
