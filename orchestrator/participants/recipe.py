"""How to make a participant: what can be sent to the process that is to hold it."""

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from .fmu import FmuParticipant
from .fmu_file import packed
from .native import Mesh, NativeParticipant
from .participant import Participant


@dataclass(frozen=True)
class Recipe:
    """A unit to be called directly on `mesh`, or an FMU by its path or content.

    `observe` are variables to be recorded.
    """

    name: str
    parameters: dict[str, Any] = field(default_factory=dict)
    unit: str | None = None
    mesh: Mesh | None = None
    fmu: Path | None = None
    content: bytes | None = None
    start: dict[str, Any] = field(default_factory=dict)
    observe: tuple[str, ...] = ()

    def portable(self) -> "Recipe":
        """The same with the FMU's content instead of its path, for a machine that has other files."""
        if self.fmu is None:
            return self
        return replace(self, content=packed(self.fmu))

    def describe(self) -> Participant:
        """The participant as far as it can be known without running anybody's code: it cannot be initialised."""
        if self.fmu is None:
            return self.make()
        return FmuParticipant(self.name, self.fmu, self.parameters, self.start, self.observe, loaded=False)

    def make(self) -> Participant:
        """The participant; InputError where it cannot be."""
        if self.fmu is None:
            if self.unit is None or self.mesh is None:
                raise TypeError("a recipe needs an FMU, or a unit and a mesh")
            return NativeParticipant(self.name, self.unit, self.mesh, self.parameters, self.observe)
        if self.content is None:
            return FmuParticipant(self.name, self.fmu, self.parameters, self.start, self.observe)
        with tempfile.TemporaryDirectory(prefix="cosim-") as folder:
            path = Path(folder) / self.fmu.name
            path.write_bytes(self.content)
            return FmuParticipant(self.name, path, self.parameters, self.start, self.observe)
