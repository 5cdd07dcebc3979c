"""The results of `cosim tune` for the strand and for the heartbeat in docs/tune.md; they take a minute or two.

Use a machine that does nothing else.
"""

from collections.abc import Mapping
from pathlib import Path

from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.tuning import summary, tune_scenario, write_tuning
from rich.console import Console

from .page import write_between

_ROOT = Path(__file__).parent.parent
_PAGE = _ROOT / "docs" / "tune.md"

_TOLERANCES: Mapping[str, Mapping[str, float]] = {
    "strand": {"activation_ms": 0.1},
    "baseline": {"lv_volume_ml": 0.2, "activation_ms": 1.0},
}


def main() -> None:
    """Tune each scenario in results/<name>.tune, as the command does, and write its messages to the page."""
    parts = []
    for name, limits in _TOLERANCES.items():
        folder = _ROOT / "results" / f"{name}.tune"
        with Bench(folder, Console()) as bench:
            tuning = tune_scenario(_ROOT / "scenarios" / f"{name}.yaml", limits, bench)
            write_tuning(tuning, folder)
        tolerances = " ".join(f"--tolerance {measure}={limit:g}" for measure, limit in limits.items())
        notes = [f"note: {note}" for note in tuning.chart.notes]
        said = "\n".join([*notes, summary(tuning)])
        parts.append(f"```text\n$ cosim tune scenarios/{name}.yaml {tolerances}\n{said}\n```")
    write_between(_PAGE, "tune", "\n\n".join(parts))


if __name__ == "__main__":
    main()
