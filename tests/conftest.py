"""What many tests share: a heart small enough to beat in a second, and a scenario for it."""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import build_body
import pytest
from cardiac_cosim.cli.app import main
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.file import read_mesh
from fallbacks import without_fallbacks

DATA = Path(__file__).parent / "data"

_SCENARIO = """\
name: small
scene: {mesh: MESH}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {stimulus_depth_mm: 5}}
  active_stress: {unit: active_stress}
  mechanics: {unit: mechanics}
coupling: {scheme: gauss-seidel, step_ms: 1}
run: {stop_ms: 10, participants: native}
output:
  every_ms: 5
  probes_mm: {base: [25, 0, -1], apex: [0, 0, -60]}
"""


@pytest.fixture(scope="session", autouse=True)
def _cache_of_our_own(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Tests neither fill the user's cache of FMUs nor take anything from it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


@pytest.fixture(scope="session")
def small_heart_file() -> Path:
    """The biventricle at 12 mm (271 nodes), made by `Biventricle().mesh(12)`; far too coarse for physics."""
    return DATA / "biventricle_12mm.msh"


@pytest.fixture(scope="session")
def small_heart(small_heart_file: Path) -> Mesh:
    return read_mesh(small_heart_file)


@pytest.fixture
def small_scenario(tmp_path: Path, small_heart_file: Path) -> Path:
    """A scenario file of a short native run on the small heart, in a folder of its own."""
    path = tmp_path / "small.yaml"
    path.write_text(_SCENARIO.replace("MESH", str(small_heart_file)))
    return path


@pytest.fixture(scope="session")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The two-mass oscillator's FMUs in C, sound and with one quirk each."""
    folder = tmp_path_factory.mktemp("bodies")
    return {
        "whole": build_body.build_body(folder / "whole.fmu"),
        "stateless": build_body.build_body(folder / "stateless.fmu", state=False),
        "equal": build_body.build_body(folder / "equal.fmu", variable_step=False),
        "holding": build_body.build_body(folder / "holding.fmu", ramps=False),
    } | {
        quirk.lower(): build_body.build_body(folder / f"{quirk.lower()}.fmu", quirk=quirk)
        for quirk in ("COMMITS", "RESETS", "ENDS", "DIES", "REASONS", "LINES", "LEAVES", "BREAKS", "TELLS")
    }


@dataclass(frozen=True)
class Ended:
    """How a call of the command ended; what is slow on this machine is left out of what it says."""

    code: int
    out: str
    err: str


@pytest.fixture
def cosim(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Ended]:
    """The command, in this process, without figures and report unless asked for.

    A traceback in a terminal is an exception here.
    """

    def call(*arguments: object) -> Ended:
        quick = ["--no-figures", "--no-report"] if arguments[0] == "run" else []
        monkeypatch.setattr(sys, "argv", ["cosim", str(arguments[0]), *quick, *map(str, arguments[1:])])
        capsys.readouterr()
        code = 0
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        out, err = capsys.readouterr()
        return Ended(code, out, without_fallbacks(err))

    return call
