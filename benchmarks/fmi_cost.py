"""What FMI costs: the baseline's first 60 ms with FMUs of both versions and by direct calls; prints the ratios."""

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
    names = {"fmu": "FMI 2.0", "fmu3": "FMI 3.0"}
    for kind in names:
        _seconds(kind)  # builds the FMUs and warms up
    rounds = [{kind: _seconds(kind) for kind in ("native", *names)} for _ in range(3)]
    for seconds in rounds:
        print(", ".join(f"{names.get(kind, kind)} {value:.2f} s" for kind, value in seconds.items()))
    for kind, name in names.items():
        print(f"median ratio {name} {median(seconds[kind] / seconds['native'] for seconds in rounds):.3f}")
