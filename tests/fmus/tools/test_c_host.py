"""If these failed, our FMUs would work in Python only: a simulator written in C could not load them, or not say why."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.orchestrator.assembly import checked_mesh
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units import kernels
from cardiac_cosim.units.registry import UNITS

_HERE = Path(__file__).parent
_CELL = _HERE.parents[2] / "scenarios" / "cell.yaml"
_STEPS = 60
_COLUMNS = {"potential_max": "potential_cell_mV", "active_stress_mean": "active_stress_mean_kPa"}

Run = Callable[..., "subprocess.CompletedProcess[str]"]

#: Which kernels our own numbers are computed with, if that was chosen.
_KERNELS = {name: os.environ[name] for name in (kernels.CHOICE,) if name in os.environ}

#: Flags of the compiler. The sanitizers look at what crosses between the host and the FMU; what Python itself keeps
#: until the process ends is no leak of ours.
_BUILDS = {"plain": ["-O1"], "sanitized": ["-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]}
_SANITIZERS = {"ASAN_OPTIONS": "detect_leaks=0"}


def _compiled(build: str, folder: Path) -> Path:
    program = folder / "host"
    command = ["cc", *_BUILDS[build], "-Wall", "-Wextra", "-Werror", f"-I{Path(fmpy.__file__).parent / 'c-code'}"]
    subprocess.run([*command, str(_HERE / "host.c"), "-o", str(program), "-ldl"], check=True)
    libraries = subprocess.run(["ldd", str(program)], capture_output=True, text=True, check=True).stdout
    assert "python" not in libraries
    return program


@pytest.fixture(scope="session")
def host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The importer, compiled against the headers of the standard."""
    return _compiled("plain", tmp_path_factory.mktemp("host"))


@pytest.fixture(scope="session")
def cell(fmi: int, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The FMUs of one cell, extracted, in the order in which they step."""
    folder = tmp_path_factory.mktemp(f"cell{fmi}")
    scenario = load_scenario(_CELL)
    mesh = checked_mesh(scenario, _CELL.parent)
    assert mesh is not None
    extracted = []
    for entry in scenario.units.values():
        unit = UNITS[str(entry.unit)]
        fmu = build_fmu(unit, mesh, folder / f"{unit.name}.fmu", fmi)
        extracted.append(Path(fmpy.extract(str(fmu), str(folder / unit.name))))
    return extracted


@pytest.fixture
def run(cell: list[Path]) -> Run:
    """Let a host couple the cell's FMUs, in an environment with nothing of Python's but what is given."""

    def call(host: Path, steps: int, *words: str, **environment: str) -> "subprocess.CompletedProcess[str]":
        parameter = "electrophysiology.time_scale_reduction=0"
        command = [str(host), "0.001", str(steps), *map(str, cell), "--set", parameter, *words]
        return subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=120,
            env={"PATH": os.environ["PATH"]} | _KERNELS | environment,
        )

    return call


@pytest.mark.parametrize("build", _BUILDS)
def test_a_program_in_c_makes_a_cell_beat_as_we_do(build: str, run: Run, tmp_path: Path) -> None:
    printed = [word for name in _COLUMNS for word in ("--print", name)]
    host = _compiled(build, tmp_path)
    done = run(host, _STEPS, *printed, COSIM_PYTHON=sys.executable, **_SANITIZERS)
    assert done.stderr == ""
    assert done.returncode == 0
    theirs = np.array([[float(number) for number in line.split()] for line in done.stdout.splitlines()])

    scenario = load_scenario(_CELL, [f"run.stop_ms={_STEPS}", "run.participants=native"])
    run_scenario(scenario, _CELL.parent, tmp_path / "own")
    own = np.genfromtxt(tmp_path / "own" / "timeseries.csv", delimiter=",", names=True)
    assert len(theirs) == len(own)
    assert np.ptp(own["potential_cell_mV"]) > 20.0
    # The probe interpolates between nodes that have all one potential: that rounds.
    tolerances = {"potential_max": 1e-12, "active_stress_mean": 0.0}
    for place, (name, column) in enumerate(_COLUMNS.items()):
        np.testing.assert_allclose(theirs[:, place], own[column], rtol=tolerances[name], atol=0, err_msg=name)


def test_without_python_our_wrapper_says_what_it_looks_for(host: Path, run: Run) -> None:
    done = run(host, 1, COSIM_PYTHON="/nowhere/python")
    assert done.returncode == 1
    message, last = done.stderr.splitlines()
    assert message.startswith(
        "fiber_generator [logStatusError, 3]: this FMU needs Python, and the command /nowhere/python"
    )
    assert "COSIM_PYTHON" in message
    assert last == "host: no instance of fiber_generator"


def test_a_python_without_a_package_is_told_which_one(host: Path, run: Run, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(bare)], check=True)
    done = run(host, 1, COSIM_PYTHON=str(bare / "bin" / "python"))
    assert done.returncode == 1
    # One message, and what the host makes of it.
    message, last = done.stderr.splitlines()
    assert "this FMU needs the Python package 'numpy', which the Python 3." in message
    assert f" at {bare} does not have" in message
    assert last == "host: no instance of fiber_generator"
