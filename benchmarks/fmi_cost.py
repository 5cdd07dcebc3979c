"""What FMI costs: the baseline's first 60 ms with FMUs and by direct calls; prints the ratios."""

from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

_SCENARIO = Path(__file__).parent.parent / "scenarios" / "baseline.yaml"


def _seconds(participants: str) -> float:
    scenario = load_scenario(_SCENARIO, ["run.stop_ms=60", f"run.participants={participants}"])
    with TemporaryDirectory() as folder:
        return float(run_scenario(scenario, _SCENARIO.parent, Path(folder)).summary["wall_s"]["total"])


if __name__ == "__main__":
    _seconds("fmu")  # builds the FMUs and warms up
    pairs = [(_seconds("native"), _seconds("fmu")) for _ in range(3)]
    for native, fmu in pairs:
        print(f"native {native:.2f} s, FMUs {fmu:.2f} s, ratio {fmu / native:.3f}")
    print(f"median ratio {median(fmu / native for native, fmu in pairs):.3f}")
