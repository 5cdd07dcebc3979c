"""What becomes of a block of YAML: it is a study, a scenario, or a part of a scenario that somebody would add."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario, validated
from cardiac_cosim.orchestrator.scenario.file import scenario_content
from cardiac_cosim.studies.plan import plan_study
from cardiac_cosim.studies.stability import plan_map
from doc_blocks import ROOT
from ruamel.yaml import YAML

_SHIPPED = sorted((ROOT / "scenarios").glob("*.yaml"))


def check_yaml(text: str, folder: Path, others: Iterable[str] = ()) -> None:
    """Check the block `text`; `folder` is to write in, `others` are the scenarios of the same page.

    A part of a scenario has to fit to one at least: to one that is shipped, or to one of the page.
    """
    content: Any = YAML(typ="safe").load(text)
    path = folder / "block.yaml"
    path.write_text(text.replace("../", f"{ROOT / 'scenarios'}/"), encoding="utf-8")
    if "lines" in content:
        (plan_map if {"theory", "bisect", "steps"} & content.keys() else plan_study)(path, [])
    elif "units" in content:
        load_scenario(path)
    else:
        _check_part(content, [*map(scenario_content, _SHIPPED), *(YAML(typ="safe").load(other) for other in others)])


def _check_part(part: dict[str, Any], wholes: Iterable[dict[str, Any]]) -> None:
    errors = []
    for whole in wholes:
        try:
            validated(whole | part, Scenario, "block")
            return
        except InputError as error:
            errors.append(str(error))
    raise AssertionError(f"the block fits to no scenario: {errors[0]}")
