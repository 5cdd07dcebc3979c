"""A scenario from Python: run it, and have its results as arrays and data frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .results.default_folder import default_folder
from .results.request import Request
from .results.stored_run import StoredRun
from .run import run_scenario
from .scenario import Scenario, scenario_content, validated, with_settings


def simulate(
    file: Path | str,
    settings: Mapping[str, Any] | None = None,
    output: Path | str | None = None,
    resume: bool = False,
) -> StoredRun:
    """Run the scenario in `file` with the values of `settings` at their keys, and open its results.

    Parameters
    ----------
    settings:
        Values by key, `{"coupling.step_ms": 5}`, as `--set` has them.
    output:
        The results folder. If not given, `results/<name>`, or, where that has results of other settings, a folder
        beside it whose name says how they differ.
    resume:
        Go on from the last checkpoint in that folder, if there is one; a run that is complete is not run again.

    Raises
    ------
    InputError
        For a scenario or a setting that is wrong; nothing was run.
    RunError
        When the physics or the coupling fails; the results up to there are in the folder.
    """
    path = Path(file)
    scenario = validated(with_settings(scenario_content(path), settings or {}), Scenario, str(path))
    folder = default_folder(scenario, resume) if output is None else Path(output)
    request = Request(str(path), settings or {})
    return StoredRun(run_scenario(scenario, path.parent, folder, resume=resume, request=request).folder)
