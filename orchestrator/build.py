"""`cosim build`: the FMUs of a scenario, and the scenario itself for tools that run FMUs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory

from .assembly import checked_mesh
from .errors import InputError
from .participants.native import Mesh, fmu_of_unit, packed_mesh
from .scenario import Scenario
from .ssp.export import write_ssp
from .systems.container import write_container
from .systems.of_scenario import MESH, beyond_the_standard, system_of
from .systems.osp import write_osp
from .systems.system import System
from .writing import allowed, make_folder


@dataclass(frozen=True)
class Built:
    """What was built of `scenario` in `folder`: the FMUs of its units by their names."""

    scenario: Scenario
    base: Path
    mesh: Mesh | None
    folder: Path
    fmus: Mapping[str, Path]

    @cached_property
    def system(self) -> System:
        """The scenario's units and connections."""
        return system_of(self.scenario, self.base, self.mesh, self.fmus)


def build_fmus(scenario: Scenario, base: Path, folder: Path, may_be_none: bool = False, fmi: int = 2) -> Built:
    """Build the FMU of every unit of `scenario`, of FMI 2.0 or 3.0, into `folder`; its paths are relative to `base`.

    InputError where there is none to build, unless there `may_be_none`.
    """
    mesh = checked_mesh(scenario, base)
    names = dict.fromkeys(entry.unit for entry in scenario.units.values() if entry.unit is not None)
    if not names and not may_be_none:
        raise InputError("there is no unit to build; every participant is an FMU already")
    make_folder(folder, "--output")
    fmus = {}
    with TemporaryDirectory(prefix="cosim-") as temporary:
        for unit in names:
            if mesh is None:
                raise TypeError("a scenario without a scene has FMUs only")
            with allowed(folder, "--output"):
                built = fmu_of_unit(unit, mesh, Path(temporary), fmi)
                fmus[unit] = copyfile(built, folder / built.name)
    return Built(scenario, base, mesh, folder, fmus)


def write_package(built: Built) -> Path:
    """Write the system package `<scenario name>.ssp`; with the mesh, for those that look at fields."""
    extra = {} if built.mesh is None else {MESH: packed_mesh(built.mesh)}
    path = built.folder / f"{built.scenario.name}.ssp"
    return _written(built, lambda: write_ssp(built.system, path, beyond_the_standard(built.scenario), extra))


def write_osp_files(built: Built) -> Path:
    """Write the system structure for libcosim, and what belongs to it."""
    return _written(built, lambda: write_osp(built.system, built.folder))


def write_container_file(built: Built) -> Path:
    """Write what fmucontainer makes one FMU of."""
    return _written(built, lambda: write_container(built.system, built.folder))


def _written(built: Built, write: Callable[[], Path]) -> Path:
    with allowed(built.folder, "--output"):
        return write()
