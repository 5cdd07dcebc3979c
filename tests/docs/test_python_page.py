"""If this failed, the examples for Python and notebooks would not run, or give something else than the page says."""

import re
from pathlib import Path
from typing import Any

from doc_blocks import ROOT, blocks

_PAGE = ROOT / "docs" / "python.md"

#: The studies of the last two examples take longer than everything else, and are run in part: what is shorter in them.
_CHART = {r"reference:\n.*\n.*\n": "reference: {coupling.step_ms: 0.2}\n", r"step_ms: \[0.5.*\]": "step_ms: [0.5, 5]"}
_MAP = {
    "bisect: 8": "bisect: 1",
    "steps: 100": "steps: 30",
    r"rate_gain_ms: \[.*\]": "rate_gain_ms: [0.5, 1]",
    r"step_ms: \[.*\]": "step_ms: [0.5, 4]",
    r"  - name: iterated\n(.*\n)*": "",
}
_SHORTER = {"scenarios/studies/strand.yaml": _CHART, "scenarios/stability/stretch_rate.yaml": _MAP}


def test_the_examples_run_as_they_stand(project: Path) -> None:
    programs = [block.text for block in blocks(_PAGE) if block.language == "python"]
    assert len(programs) == 5
    names: dict[str, Any] = {}
    for program in programs:
        for study, shorter in _SHORTER.items():
            if study in program:
                (project / Path(study).name).write_text(_changed(study, shorter), encoding="utf-8")
                program = program.replace(study, Path(study).name)
        exec(program.replace('["run.participants=native"]', '["run.participants=native", "run.stop_ms=10"]'), names)
    assert names["run"].summary["activation_time_ms"]["near"] > 10.0
    assert len(names["series"]) == 61
    assert names["potential"].shape == (len(names["run"].points_mm),)
    assert (project / "results" / "strand_coupling" / "chart.csv").is_file()
    assert (project / "results" / "stretch_rate" / "stability.html").is_file()
    assert all(crossing.predicted for crossing in names["found"].panels[0].crossings)


def _changed(study: str, changes: dict[str, str]) -> str:
    """The study as it ships, with every one of the `changes` made."""
    text = (ROOT / study).read_text(encoding="utf-8").replace("../", "scenarios/")
    for old, new in changes.items():
        text, count = re.subn(old, new, text)
        assert count, f"{study}: {old}"
    return text
