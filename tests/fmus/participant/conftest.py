"""Participants that leave nothing behind."""

import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.participants.fmu import FmuParticipant


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that temporary files go to in this test."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture
def join(temporary: Path) -> Iterator[Callable[..., FmuParticipant]]:
    """Make a participant; closed when the test ends, and then nothing is left of it on disk or on the path."""
    made: list[FmuParticipant] = []
    path = list(sys.path)

    def make(file: Path, name: str = "guest", start: dict[str, Any] | None = None, **parameters: Any) -> FmuParticipant:
        made.append(FmuParticipant(name, file, parameters, start))
        return made[-1]

    yield make
    for participant in made:
        participant.close()
        # A second time does nothing.
        participant.close()
    assert list(temporary.iterdir()) == []
    assert sys.path == path


@pytest.fixture
def ready(join: Callable[..., FmuParticipant]) -> Callable[..., FmuParticipant]:
    """Make a participant and initialise it."""

    def make(*given: Any, **named: Any) -> FmuParticipant:
        participant = join(*given, **named)
        participant.begin()
        participant.complete()
        return participant

    return make
