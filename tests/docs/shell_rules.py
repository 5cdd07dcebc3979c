"""What becomes of a command that a page shows: whether it would work, and where that is quick, it is run."""

import importlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario
from cardiac_cosim.studies.plan import plan_study
from cardiac_cosim.studies.stability import plan_map
from doc_blocks import ROOT
from documented_command import DocumentedCommand, parsed, words_of
from ruamel.yaml import YAML

#: What the tests leave out, by the program that does it or the file that it takes, and why.
EXCEPTIONS = {
    "apt-get": "installs packages of the system, which is the business of whoever sets the tests up",
    "git": "fetches the project from where it is kept",
    "Dahlquist.fmu": "an FMU of the Modelica Association, which the project does not have",
}

#: Folders in which runs and studies leave their results, if they are not told where.
_RESULTS = Path("results")

_Cosim = Callable[..., Any]


class Reader:
    """Somebody who gives the commands of a page one after the other, in a folder like the project's."""

    def __init__(self, folder: Path, cosim: _Cosim) -> None:
        self._folder = folder
        self._cosim = cosim
        #: Folders that the commands so far write to, whether they were run or not.
        self._written: list[Path] = []
        self.run = 0

    def follow(self, line: str) -> None:
        """Check one command; AssertionError or an exception of the command's if it would not work."""
        program = line.split()[0]
        name = program.rpartition("/")[2]
        if name in EXCEPTIONS:
            return
        if name == "cosim":
            self._call(parsed(words_of(line)), words_of(line))
        elif name.startswith("python"):
            self._python(words_of(line))
        elif program == "./setup.sh":
            assert set(words_of(line)) <= {"test"}
            assert (ROOT / "setup.sh").stat().st_mode & 0o111
        elif name in (".", "source"):
            (script,) = words_of(line)
            assert (self._folder / script).is_file(), line
        elif name == "xdg-open":
            for word in words_of(line):
                self._expect(Path(word))
        elif name == "pre-commit":
            assert (ROOT / ".pre-commit-config.yaml").is_file()
        else:
            raise AssertionError(
                f"no rule says how the command {line!r} is tested; add one, or an exception with its reason"
            )

    # --- cosim --------------------------------------------------------------------------------------------------------

    def _call(self, command: DocumentedCommand, words: list[str]) -> None:
        for place in command.places:
            if place.name not in EXCEPTIONS:
                self._check(command, place, words)
        if not command.places:
            self._run(*words)
        self._written.append(command.output or _RESULTS)

    def _check(self, command: DocumentedCommand, place: Path, words: list[str]) -> None:
        found = sorted(self._folder.glob(str(place)))
        if (
            not found
            or command.name in ("chart", "stability", "tune", "errors")
            or place.suffix not in (".yaml", ".ssp")
        ):
            if place.suffix == ".yaml" and found:
                self._check_content(command, place)
            elif command.name == "verify" and found:
                self._run("verify", *found)
            else:
                self._expect(place)
        elif place.suffix == ".ssp":
            # It was built by a command before, and is a small one.
            self._run(*words, *self._short_of(None, command.name))
        elif "lines" in YAML(typ="safe").load(place.read_text(encoding="utf-8")):
            plan_study(place, command.assignments)
        else:
            scenario = load_scenario(place, command.assignments)
            quick = _is_quick(scenario) and not command.options.get("error_budget")
            if command.name == "show" or (command.name in ("run", "build") and quick):
                self._run(*words, *self._short_of(scenario, command.name))
            elif command.name in ("run", "build"):
                # The mesh, the parameters and the connections are looked at.
                sets = [f"--set={assignment}" for assignment in command.assignments]
                self._run("show", place, *sets)

    def _check_content(self, command: DocumentedCommand, place: Path) -> None:
        """What a study, or the scenario that studies are made of, says."""
        if command.name == "stability":
            plan_map(place, command.assignments)
        elif command.name == "chart":
            plan_study(place, command.assignments)
        else:
            load_scenario(place, command.assignments)
            for measure in command.options.get("tolerances") or ():
                assert float(measure.partition("=")[2]) > 0.0
            if command.options.get("study"):
                plan_study(command.options["study"], command.assignments)

    def _expect(self, place: Path) -> None:
        """The file or folder is there, or a command before this one writes it."""
        there = any(self._folder.glob(str(place)))
        assert there or any(place.is_relative_to(folder) for folder in self._written), f"nothing before makes {place}"

    def _run(self, *words: object) -> None:
        ended = self._cosim(*words)
        assert ended.code == 0, f"cosim {' '.join(map(str, words))}: {ended.err}"
        self.run += 1

    def _short_of(self, scenario: Scenario | None, command: str) -> list[str]:
        """Settings with which a run takes two steps only."""
        if command != "run":
            return []
        step = 1.0 if scenario is None else scenario.coupling.step_ms
        if scenario is not None and scenario.coupling.adaptive is not None:
            step = scenario.coupling.adaptive.max_ms
        return [f"--set=run.stop_ms={2 * step:g}", f"--set=output.every_ms={2 * step:g}"]

    # --- Python -------------------------------------------------------------------------------------------------------

    def _python(self, words: list[str]) -> None:
        if words[:2] == ["-m", "pytest"]:
            # It reads its arguments and its settings, and collects the tests of one small file, if no others are named.
            own = [] if any((ROOT / word).exists() for word in words[2:]) else ["--noconftest", "tests/test_static.py"]
            command = [sys.executable, *words, "--collect-only", "-q", *own]
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            assert done.returncode in (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED), done.stderr
        elif words[0] == "-m" and words[1].startswith("benchmarks"):
            check_benchmark(words[1:])
        elif words[:2] == ["-m", "sphinx"]:
            # The test of the site builds it by this command.
            assert words[2:] == SITE_COMMAND
        elif words == ["docs/generate"]:
            assert (ROOT / words[0] / "__main__.py").is_file()
        else:
            raise AssertionError(f"no rule says how `python {' '.join(words)}` is tested; add one")


#: The arguments by which the site is built.
SITE_COMMAND = ["-c", "docs", ".", "site"]


def check_benchmark(words: list[str]) -> None:
    """`python -m benchmarks.…`: there is such a program, and its arguments are names of what it can be run for."""
    module, *arguments = words
    found = importlib.util.find_spec(module)
    assert found is not None, module
    if found.submodule_search_locations is not None:
        module = f"{module}.__main__"
    importlib.import_module(module)
    for argument in arguments:
        known = [*ROOT.glob(f"scenarios/{argument}.yaml"), *ROOT.glob(f"scenarios/*/{argument}.yaml")]
        assert known or argument.isupper(), f"{argument} is no scenario and no study"


def _is_quick(scenario: Scenario) -> bool:
    """Whether two steps of it, its FMUs included, take a second or two."""
    scene = scenario.scene
    coarse = scene is None or (scene.geometry not in (None, "biventricle") and scene.refine == 0)
    return coarse and not any(entry.parameters.get("refine") for entry in scenario.units.values())
