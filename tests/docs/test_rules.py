"""If this failed, the tests of the pages would pass whatever stood on the pages."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from doc_blocks import command_lines
from documented_command import parsed, words_of
from shell_rules import Reader
from yaml_rules import check_yaml


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ("cosim run scenarios/cell.yaml --participant native", "No such option"),
        ("cosim ran scenarios/cell.yaml", "No such command"),
        ("cosim run", "[Mm]issing"),
        ("cosim run scenarios/cell.yaml --set coupling.stepms=1", "did you mean"),
        ("cosim show scenarios/cell.yaml --set units.mechanics.parameters.stifness=1", "stifness"),
        (
            "cosim run scenarios/baseline.yaml --set units.mechanics.parameters.shear_modulus_MPa=-1",
            "shear_modulus_MPa",
        ),
        ("cosim run scenarios/nothing.yaml", "nothing before makes"),
        ("cosim run fmus-built/strand.ssp", "nothing before makes"),
        ("cosim chart scenarios/cell.yaml", "cell.yaml"),
        ("python -m benchmarks.nothing", "benchmarks.nothing"),
        ("python -m benchmarks.charts nothing", "no scenario and no study"),
        ("python -m pytest --no-such-option", "no-such-option"),
        ("curl https://example.org", "no rule says"),
    ],
)
def test_a_command_that_does_not_work_is_found(line: str, wrong: str, project: Path, cosim: Callable[..., Any]) -> None:
    with pytest.raises(Exception, match=wrong):
        Reader(project, cosim).follow(line)


def test_what_an_earlier_command_writes_may_be_used(project: Path, cosim: Callable[..., Any]) -> None:
    reader = Reader(project, cosim)
    reader.follow("cosim build scenarios/baseline.yaml --output my-fmus")
    reader.follow("cosim verify my-fmus/*.fmu")
    reader.follow("cosim run scenarios/cell.yaml --output one")
    assert (project / "one" / "timeseries.csv").is_file()


def test_commands_are_taken_apart_as_a_shell_does() -> None:
    text = "cosim run a.yaml \\\n    --set x=1   # a note\n./setup.sh && cosim show a.yaml > out.txt\n"
    lines = list(command_lines(text))
    assert lines == ["cosim run a.yaml      --set x=1   # a note", "./setup.sh", "cosim show a.yaml > out.txt"]
    assert parsed(words_of(lines[0])).assignments == ["x=1"]
    assert words_of(lines[2]) == ["show", "a.yaml"]


@pytest.mark.parametrize(
    "text",
    [
        "coupling: {step: 1}",
        "name: x\nscenario: ../cell.yaml\nlines: [{name: a, vary: {coupling.step: [1]}}]\nreference: {run.stop_ms: 9}",
        "name: x\nunits: {a: {unit: mass, fmu: b.fmu}}",
    ],
    ids=["part", "study", "scenario"],
)
def test_a_block_of_yaml_that_is_not_valid_is_found(text: str, project: Path) -> None:
    with pytest.raises((AssertionError, InputError)):
        check_yaml(text, project)
