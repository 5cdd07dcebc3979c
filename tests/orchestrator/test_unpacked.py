"""If these fail, a study unpacks the same FMUs for every point, or its points get into each other's way."""

from collections.abc import Iterator
from pathlib import Path

import build_body
import pytest
from cardiac_cosim.fmus.cache import cached_fmu
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant
from cardiac_cosim.orchestrator.participants.unpacked import keep_unpacked
from cardiac_cosim.orchestrator.run import run_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.mesh import Mesh


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Path]:
    """Where this process keeps what it unpacks."""
    folder = tmp_path / "kept"
    folder.mkdir()
    keep_unpacked(folder)
    yield folder
    keep_unpacked(None)


def _started(path: Path, name: str = "a") -> FmuParticipant:
    participant = FmuParticipant(name, path, {})
    participant.begin()
    participant.complete()
    return participant


def test_runs_in_one_process_unpack_once_and_give_the_same_bits(
    small_scenario: Path, tmp_path: Path, place: Path
) -> None:
    scenario = load_scenario(small_scenario, ["run.participants=fmu", "run.stop_ms=3"])

    def series(name: str) -> bytes:
        run_scenario(scenario, tmp_path, tmp_path / name, fmu_dir=tmp_path)
        return (tmp_path / name / "timeseries.csv").read_bytes()

    first, kept = series("first"), sorted(place.iterdir())
    assert len(kept) == 4
    assert series("second") == first
    assert sorted(place.iterdir()) == kept
    keep_unpacked(None)
    assert series("alone") == first
    assert sorted(place.iterdir()) == kept


def test_participants_at_the_same_time_have_folders_of_their_own(
    small_heart: Mesh, tmp_path: Path, place: Path
) -> None:
    path = cached_fmu(ActiveStress, small_heart, tmp_path)
    one, other = _started(path), _started(path, "b")
    assert len(list(place.iterdir())) == 2
    one.close()
    again = _started(path, "c")
    assert len(list(place.iterdir())) == 2
    for participant in (other, again):
        participant.close()
    # One of which somebody took a file away is none any more.
    for folder in place.iterdir():
        (folder / "modelDescription.xml").unlink()
    last = _started(path, "d")
    (folder,) = place.iterdir()
    assert (folder / "modelDescription.xml").is_file()
    last.close()


def test_an_fmu_that_did_not_get_to_work_leaves_nothing(small_heart: Mesh, tmp_path: Path, place: Path) -> None:
    FmuParticipant("a", cached_fmu(ActiveStress, small_heart, tmp_path), {}).close()
    assert list(place.iterdir()) == []


@pytest.mark.skipif(build_body.compiler() is None, reason="no C compiler to build foreign FMUs with")
def test_foreign_fmus_are_never_kept(tmp_path: Path, place: Path) -> None:
    # Who knows what it writes into its folder.
    _started(build_body.build_body(tmp_path / "body.fmu")).close()
    assert list(place.iterdir()) == []
