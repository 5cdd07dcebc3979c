"""The errors of held inputs on the heart, with their signs: `python docs/pictures/signed_errors.py` (a minute).

Writes the table in docs/theory.md and draws the error of the left ventricle's volume over time.
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from canvas import BLACK, GREY, figure, save
from cardiac_cosim.orchestrator.results.stored_run import StoredRun
from cardiac_cosim.orchestrator.simulation import simulate

_ROOT = Path(__file__).parent.parent.parent
sys.path.insert(0, str(_ROOT))

from benchmarks.page import write_between  # noqa: E402

_PAGE = _ROOT / "docs" / "theory.md"
_COMMON = {"run.participants": "native", "output.every_ms": 20}
_HELD = {"coupling.interpolation": "hold", "coupling.extrapolation": 0, "coupling.step_ms": 1}
#: As in scenarios/studies/heartbeat.yaml.
_ITERATED = {"coupling.iterate": {"acceleration": "anderson", "converge": {"stretch": {"relative": 1e-5}}}}
#: Without feedback the mechanics is solved at output times only.
_OPEN = {"units.electrophysiology.parameters.stretch_conductance": 0, "output.every_ms": 5}

#: What the errors are differences from: linear inputs in short steps.
_REFERENCE = {"coupling.step_ms": 0.25}

#: By scheme, its settings, and by how many ms the contraction is late if the wave is in time: half a step for the input
#: of the active stress, and a whole one where the mechanics, which has no memory, is given the step's beginning.
_SCHEMES: dict[str, tuple[dict[str, Any], float]] = {
    "Jacobi": ({"coupling.scheme": "jacobi"}, 1.5),
    "Gauss–Seidel": ({}, -0.5),
    "iterated": (_ITERATED, -0.5),
}


def _run(settings: Mapping[str, Any], folder: Path) -> StoredRun:
    return simulate(_ROOT / "scenarios" / "baseline.yaml", {**_COMMON, **settings}, folder)


def _volume(run: StoredRun) -> tuple[np.ndarray, np.ndarray]:
    """Times in ms at which the mechanics was solved, and the left ventricle's volume in ml."""
    solved = np.isfinite(run.columns["lv_volume_ml"])
    return run.columns["time_ms"][solved], run.columns["lv_volume_ml"][solved]


def _row(name: str, late_ms: float, run: StoredRun, reference: StoredRun) -> tuple[str, np.ndarray]:
    """A row of the table, and the error of the volume in ml at the times of the run."""
    (times, volume), (fine, right) = _volume(run), _volume(reference)
    errors = volume - right[np.searchsorted(fine, times - 1e-9)]
    activation = run.frame("activation_time_ms", -1) - reference.frame("activation_time_ms", -1)
    wave = float(activation.mean())
    steepest = -float(np.min(np.diff(right) / np.diff(fine)))
    worst = errors[np.abs(errors).argmax()]
    cells = [
        f"{wave:+.2f} ms",
        f"{late_ms + wave:+.2f} ms",
        f"{steepest * (late_ms + wave):+.2f} ml",
        f"{worst:+.2f} ml",
    ]
    return "| " + " | ".join([name, *cells]).replace("-", "−").replace("+0.00", "0.00") + " |", errors


def measure() -> str:
    """The table; the picture is drawn on the way."""
    rows = [
        "| inputs held, 1 ms | wave late by | contraction late by | volume error, expected | found |",
        "|---|---|---|---|---|",
    ]
    picture = figure(3.4)
    axes = picture.add_subplot()
    styles = iter(("-.", "--", "-"))
    with TemporaryDirectory() as name:
        folder = Path(name)
        reference = _run(_REFERENCE, folder / "reference")
        for scheme, (settings, late_ms) in _SCHEMES.items():
            run = _run(_HELD | settings, folder / scheme)
            row, errors = _row(scheme, late_ms, run, reference)
            rows.append(row)
            axes.plot(_volume(run)[0], errors, next(styles), color=BLACK, linewidth=1.4, label=scheme)
        without = _run(_REFERENCE | _OPEN, folder / "reference without feedback")
        rows.append(
            _row("Gauss–Seidel, no feedback", -0.5, _run(_HELD | _OPEN, folder / "without feedback"), without)[0]
        )
    axes.axhline(0.0, color=GREY, linewidth=0.6, zorder=0)
    axes.set_xlim(0.0, 200.0)
    axes.set_xlabel("time in ms")
    axes.set_ylabel("error of the LV volume in ml")
    axes.legend(frameon=False, title="inputs held, 1 ms")
    print(save(picture, "signed_errors"))
    return "\n".join(rows)


if __name__ == "__main__":
    write_between(_PAGE, "signed_errors", measure())
