"""Where the FMUs of a run's units are built and found."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

from .errors import InputError
from .participants.native import Mesh, fmu_of_unit
from .writing import make_folder


class FmuFolder:
    """The folder that the person chose, or the user's cache.

    Where that cache cannot be written, as in a container without a home, a temporary folder serves, which goes when
    the `stack` is left.
    """

    def __init__(self, stack: ExitStack, chosen: Path | None) -> None:
        if chosen is not None:
            make_folder(chosen, "--fmu-dir")
        self._stack = stack
        self._chosen = chosen
        self._temporary: Path | None = None

    def fmu(self, unit: str, mesh: Mesh, fmi: int) -> Path:
        """The FMU of a unit on `mesh`, of FMI 2.0 or 3.0; InputError where there is no place for it."""
        try:
            return fmu_of_unit(unit, mesh, self._chosen or self._temporary, fmi)
        except OSError as error:
            if self._chosen is not None or self._temporary is not None:
                place = self._chosen or self._temporary
                raise InputError(
                    f"the FMU of unit '{unit}' cannot be built in {place} ({error.strerror}); "
                    "make room there, or choose another folder with --fmu-dir"
                ) from None
        try:
            self._temporary = Path(self._stack.enter_context(TemporaryDirectory(prefix="cosim-fmus-")))
        except OSError as error:
            raise InputError(
                f"neither the user's cache nor a temporary folder can be written ({error.strerror}); "
                "choose a folder for FMUs with --fmu-dir"
            ) from None
        return self.fmu(unit, mesh, fmi)
