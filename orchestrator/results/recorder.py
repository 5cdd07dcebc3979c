"""What writes results of a run, and can go on with them after a checkpoint."""

from typing import Any, Protocol

from ..coupling.master import Observer


class Recorder(Observer, Protocol):
    """An observer with a file."""

    def memory(self) -> dict[str, Any]:
        """What it needs to go on in the same folder from here, for a checkpoint."""

    def close(self) -> None:
        """Complete the file and close it."""
