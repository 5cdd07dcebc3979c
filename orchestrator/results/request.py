"""How a run was asked for: beside the resolved scenario, what a person who looks at its results wants to know."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class Request:
    """The scenario's file, where there was one, and the keys whose values were set beside it (`--set`)."""

    file: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def content(self) -> dict[str, Any]:
        """For the summary."""
        return {"request": {"file": self.file, "settings": dict(self.settings)}}
