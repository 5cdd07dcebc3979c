"""If this failed, the first page that a newcomer reads would tell something that is not so."""

import sys

from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.stability.registry import THEORIES
from doc_blocks import ROOT


def test_ci_runs_the_test_command_of_the_readme() -> None:
    command = "./setup.sh test && .venv/bin/python -m pytest -n 2"
    assert f"```sh\n{command}\n```" in (ROOT / "README.md").read_text(encoding="utf-8")
    assert (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()[-1] == command


def test_every_scenario_is_valid() -> None:
    scenarios = sorted((ROOT / "scenarios").glob("*.yaml"))
    assert scenarios
    for scenario in scenarios:
        assert load_scenario(scenario).name == scenario.stem


def test_the_page_on_stability_tells_of_every_theory_and_of_every_map() -> None:
    text = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    for name in THEORIES:
        assert f"`{name}`" in text
    for study in (ROOT / "scenarios" / "stability").glob("*.yaml"):
        assert f"<!-- {study.stem}: " in text, f"docs/stability.md says nothing of {study.stem}"


def test_supported_python_is_the_one_that_runs() -> None:
    assert (3, 11) <= sys.version_info[:2] <= (3, 13)
