"""If this failed, the documentation would tell a newcomer something that is not so."""

import importlib.util
import re
import shlex
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.studies.stability import plan_map
from cardiac_cosim.units.stability.registry import THEORIES

_ROOT = Path(__file__).parent.parent


def test_tables_of_the_units_are_those_of_the_declarations() -> None:
    spec = importlib.util.spec_from_file_location("unit_tables", _ROOT / "docs" / "unit_tables.py")
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    assert tables.PAGE.read_text(encoding="utf-8") == tables.page(), "run `python docs/unit_tables.py`"


def test_ci_runs_the_test_command_of_the_readme() -> None:
    command = "./setup.sh test && .venv/bin/python -m pytest -n 2"
    assert f"```sh\n{command}\n```" in (_ROOT / "README.md").read_text(encoding="utf-8")
    assert (_ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1] == command


def test_every_file_that_the_readme_links_to_is_there() -> None:
    for part in (_ROOT / "README.md").read_text(encoding="utf-8").split("](")[1:]:
        target = part.split(")")[0]
        if not target.startswith("http"):
            assert (_ROOT / target).exists(), target


def test_diffs_that_the_pages_show_are_those_of_the_files() -> None:
    # Whoever adds a law or a geometry goes by them.
    shown = 0
    for page in ("CONTRIBUTING.md", "docs/scenes.md"):
        for block in (_ROOT / page).read_text(encoding="utf-8").split("```diff\n")[1:]:
            file: list[str] = []
            for line in block.split("```")[0].splitlines():
                if line.startswith("+++ b/"):
                    file = (_ROOT / line.removeprefix("+++ b/")).read_text(encoding="utf-8").splitlines()
                elif line.startswith("+") and line[1:].strip() != "...":
                    assert line[1:] in file, line
                    shown += 1
    assert shown >= 8


def test_every_run_that_the_readme_shows_has_a_valid_scenario() -> None:
    text = (_ROOT / "README.md").read_text(encoding="utf-8").replace("\\\n", " ")
    runs = [shlex.split(line, comments=True) for line in text.splitlines() if line.startswith("cosim run ")]
    assert len(runs) >= 4
    built = [
        Path(shlex.split(line)[2]).stem
        for line in text.splitlines()
        if line.startswith("cosim build ") and "--ssp" in line
    ]
    for words in runs:
        if words[2].endswith(".ssp"):
            # The package that a line before has built, in the folder of `cosim build`.
            assert words[2] in [f"fmus-built/{name}.ssp" for name in built]
            continue
        assignments = [value for option, value in pairwise(words) if option == "--set"]
        load_scenario(_ROOT / words[2], assignments)


def test_every_scenario_is_valid() -> None:
    scenarios = sorted((_ROOT / "scenarios").glob("*.yaml"))
    assert scenarios
    for scenario in scenarios:
        assert load_scenario(scenario).name == scenario.stem


def test_the_study_that_the_page_on_stability_shows_is_one(tmp_path: Path) -> None:
    text = (_ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    (block,) = [part.split("```")[0] for part in text.split("```yaml\n")[1:]]
    study = tmp_path / "study.yaml"
    study.write_text(block.replace("../", f"{_ROOT / 'scenarios'}/"), encoding="utf-8")
    assert plan_map(study, ()).theory is not None
    for name in THEORIES:
        assert f"`{name}`" in text
    for study in (_ROOT / "scenarios" / "stability").glob("*.yaml"):
        assert f"<!-- {study.stem}: " in text, f"docs/stability.md says nothing of {study.stem}"


def test_supported_python_is_the_one_that_runs() -> None:
    assert (3, 11) <= sys.version_info[:2] <= (3, 13)


def test_the_example_for_python_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "scenarios").symlink_to(_ROOT / "scenarios")
    monkeypatch.chdir(tmp_path)
    text = (_ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    blocks = [block.split("```")[0] for block in text.split("```python\n")[1:]]
    assert len(blocks) == 5
    names: dict[str, Any] = {}
    # The last two, studies, take longer than all others; they are run in part.
    (tmp_path / "small.yaml").write_text(
        _shortened((_ROOT / "scenarios" / "stability" / "stretch_rate.yaml").read_text(encoding="utf-8"))
    )
    for block in blocks:
        short = block.replace('["run.participants=native"]', '["run.participants=native", "run.stop_ms=40"]')
        exec(short.replace("scenarios/stability/stretch_rate.yaml", "small.yaml"), names)
    assert names["run"].summary["activation_time_ms"]["near"] > 10.0
    assert len(names["series"]) == 61
    assert names["potential"].shape == (len(names["run"].points_mm),)
    assert (tmp_path / "results" / "strand_coupling" / "chart.csv").is_file()
    assert (tmp_path / "results" / "stretch_rate" / "stability.html").is_file()
    assert all(crossing.predicted for crossing in names["found"].panels[0].crossings)


def _shortened(study: str) -> str:
    """The study of the rate with two values on each axis, halved once."""
    study = study.replace("../", "scenarios/").replace("bisect: 8", "bisect: 1").replace("steps: 100", "steps: 30")
    study = re.sub(r"rate_gain_ms: \[.*\]", "rate_gain_ms: [0.5, 1]", study)
    return re.sub(r"step_ms: \[.*\]", "step_ms: [0.5, 4]", study)
