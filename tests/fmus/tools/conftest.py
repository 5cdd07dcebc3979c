"""A workshop in which the commands and the code of the pages in docs/tools are run as they stand there."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario

_ROOT = Path(__file__).parents[3]
_PAGES = _ROOT / "docs" / "tools"
_BLOCK = re.compile(r"^```(sh|python|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
#: What installs something is the business of whoever sets the tests up.
_INSTALLS = re.compile(r"^(apt-get|pip|python3 -m venv) ")

Course = dict[str, np.ndarray]


class Workshop:
    """A folder that looks like the project's to a command, with the FMUs of the scenes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / ".venv").symlink_to(sys.prefix)
        for name in ("scenarios", "tests"):
            (folder / name).symlink_to(_ROOT / name)

    def follow(self, page: str, python: str = sys.executable) -> list[str]:
        """Run all that stands on a page, in order; each line it promises has to be printed by what stands before it.

        Numbers may differ from the page's in their last digits, as they do between processors (docs/speed.md). Returns
        the lines that were promised as they were printed.
        """
        promised: list[str] = []
        printed = ""
        for language, text in _BLOCK.findall((_PAGES / f"{page}.md").read_text(encoding="utf-8")):
            if language == "text":
                for line in text.splitlines():
                    found = next((other for other in printed.splitlines() if _alike(line, other)), None)
                    assert found is not None, f"{line!r} is not in:\n{printed}"
                    promised.append(found)
            elif not _INSTALLS.match(text):
                printed = self.run([python, "-c", text] if language == "python" else ["bash", "-euc", text])
        return promised

    def run(self, command: list[str]) -> str:
        """Standard output of `command`, which has to end well."""
        done = subprocess.run(
            command, cwd=self.folder, capture_output=True, text=True, timeout=300, stdin=subprocess.DEVNULL
        )
        assert done.returncode == 0, f"exit code {done.returncode}\n{command[-1]}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def load(self, name: str) -> np.ndarray:
        """What a page's code has saved."""
        values: np.ndarray = np.load(self.folder / name)
        return values


def _alike(line: str, other: str) -> bool:
    """Whether two lines have the same words, numbers among them to nine digits."""
    words, others = line.split(), other.split()
    return len(words) == len(others) and all(map(_same, words, others))


def _same(word: str, other: str) -> bool:
    try:
        return float(word) == pytest.approx(float(other), rel=1e-9)
    except ValueError:
        return word == other


@pytest.fixture(scope="session")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    """The workshop after the commands of the index, which build the FMUs."""
    workshop = Workshop(tmp_path_factory.mktemp("workshop"))
    workshop.follow("README")
    return workshop


@pytest.fixture(scope="session")
def ours(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Course]:
    """Fields at every step of a run of our own, without FMI, by their columns in fields.h5; scalars by theirs."""

    def run(scene: str, *sets: str) -> Course:
        path = _ROOT / "scenarios" / f"{scene}.yaml"
        fixed = ("run.participants=native", "output.every_ms=1")
        folder = tmp_path_factory.mktemp(scene)
        run_scenario(load_scenario(path, [*fixed, *sets]), path.parent, folder)
        series = np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)
        with h5py.File(folder / "fields.h5") as file:
            fields = {name: np.array(values) for name, values in file["frames"].items()}
        return {**{name: series[name] for name in series.dtype.names or ()}, **fields}

    return run


@pytest.fixture(scope="session")
def strand(ours: Callable[..., Course]) -> Course:
    """The strand of the pages by our Jacobi scheme, 30 steps."""
    return ours("strand", "scene.mesh_size_mm=4", "coupling.scheme=jacobi", "run.stop_ms=30")
