"""The only module that imports units: meshes, declarations, and units as participants without FMI."""

from collections.abc import Collection, Mapping, Sequence
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ...fmus.cache import cached_fmu
from ...units.errors import InvalidInput, StepFailure
from ...units.geometry.registry import GEOMETRIES
from ...units.geometry.registry import build as build_geometry
from ...units.mesh import Mesh
from ...units.mesh.archive import pack_mesh
from ...units.mesh.file import read_mesh
from ...units.mesh.frame import check_frame, frame_warnings
from ...units.mesh.places import Places
from ...units.mesh.quality import signed_inverse_condition_number
from ...units.mesh.refinement import check_levels, refined
from ...units.mesh.wall import wall_warnings
from ...units.registry import UNITS
from ...units.snapshot import Snapshot
from ...units.stability.registry import THEORIES
from ...units.stability.theory import Coupled, Moment, Setting, Theory
from ...units.statistics import Statistic
from ...units.unit import Unit
from ...units.variable import Causality, Variable
from ..errors import InputError, ParticipantError, did_you_mean
from ..scenario import Scene
from .accuracy import AccuracyParameter
from .participant import Abilities, Implementation, Parameters, Port, Ports, Ramp, Values, Wait
from .ramping import Ramps, whole
from .unit_parameter import UnitParameter

__all__ = [
    "Coupled",
    "Mesh",
    "Moment",
    "NativeParticipant",
    "Setting",
    "Theory",
    "accuracy_parameters",
    "amplification",
    "check_mesh",
    "check_unit",
    "element_quality",
    "fmu_of_unit",
    "geometry_names",
    "is_memoryless",
    "located",
    "mesh_warnings",
    "packed_mesh",
    "scene_mesh",
    "stability_theory",
    "theory_names",
    "unit_names",
    "unit_parameters",
    "unit_ports",
    "unit_setting",
    "unit_summary",
    "unit_warnings",
]


def scene_mesh(scene: Scene, folder: Path) -> Mesh:
    """The mesh of `scene`, refined as it says; a mesh file's path is relative to `folder`.

    InputError if there is none to be had, or if it is refined to more elements than a computer holds.
    """
    try:
        if scene.mesh is not None:
            mesh = read_mesh(folder / scene.mesh, scene.boundaries, scene.unit_mm)
        else:
            mesh = build_geometry(str(scene.geometry), scene.mesh_size_mm)
        check_levels(mesh, scene.refine, "`refine`")
        return refined(mesh, scene.refine).mesh
    except InvalidInput as error:
        raise InputError(str(error)) from None


def check_mesh(mesh: Mesh, scene: Scene, folder: Path, units: Collection[str]) -> None:
    """InputError for a mesh that stands in another frame than `units` take for granted, or lacks what they need of it.

    A mesh file's path is in front of what is wrong with it.
    """
    try:
        if units:
            check_frame(mesh, scene.scale is not None)
        for unit in units:
            UNITS[unit].check_mesh(mesh)
    except InvalidInput as error:
        origin = "" if scene.mesh is None else f"{folder / scene.mesh}: "
        raise InputError(f"{origin}{error}") from None


def mesh_warnings(mesh: Mesh, scene: Scene) -> list[str]:
    """What was changed to read the mesh, and what is unusual of it."""
    return [*mesh.notes, *wall_warnings(mesh), *frame_warnings(mesh, scene.scale is not None)]


def unit_warnings(unit: str, parameters: Parameters, mesh: Mesh) -> list[str]:
    """What is unusual of a unit's parameters on `mesh`: places that are not where the mesh has them."""
    asked = UNITS[unit](mesh)
    asked.instantiate(parameters)
    return list(asked.warnings())


def packed_mesh(mesh: Mesh) -> bytes:
    """The mesh as the content of a file that `scene.mesh` may name."""
    with TemporaryDirectory(prefix="cosim-") as folder:
        path = Path(folder) / "mesh.npz"
        pack_mesh(mesh, path)
        return path.read_bytes()


def check_unit(unit: str, parameters: Parameters) -> None:
    """InputError if there is no such unit, or if it has no such parameter or none with such a value."""
    declared = _declared_parameters(unit)
    for name, value in parameters.items():
        if name not in declared:
            raise InputError(f"unit '{unit}' has no parameter '{name}'{did_you_mean(name, declared)}")
        try:
            declared[name].checked(value)
        except InvalidInput as error:
            raise InputError(str(error)) from None


def accuracy_parameters(unit: str) -> Mapping[str, AccuracyParameter]:
    """The parameters that decide the numerical error of a unit, by name; InputError if there is no such unit."""
    return {
        name: AccuracyParameter(name, variable.refines.value, variable.start, *_lower_limit(variable))
        for name, variable in _declared_parameters(unit).items()
        if variable.refines is not None and isinstance(variable.start, int | float)
    }


def geometry_names() -> list[str]:
    """The anatomies that `scene.geometry` may name."""
    return sorted(GEOMETRIES)


def unit_names() -> list[str]:
    """The units that a scenario may name."""
    return list(UNITS)


def theory_names() -> list[str]:
    """The theories of stability that a study may name."""
    return sorted(THEORIES)


def unit_summary(unit: str) -> str:
    """What a unit is, in one sentence; InputError if there is no such unit."""
    return (_kind(unit).__doc__ or "").partition("\n")[0]


def unit_parameters(unit: str) -> list[UnitParameter]:
    """The parameters of a unit in the order of their declaration; InputError if there is no such unit."""
    return [
        UnitParameter(
            name,
            variable.start,
            variable.unit,
            variable.description,
            variable.above,
            variable.at_least,
            variable.below,
            variable.choices,
        )
        for name, variable in _declared_parameters(unit).items()
    ]


def _lower_limit(variable: Variable) -> tuple[float, bool]:
    """The lower limit of a parameter, and whether it is allowed itself."""
    if variable.at_least is not None:
        return variable.at_least, True
    return (-inf if variable.above is None else variable.above), False


def _declared_parameters(unit: str) -> dict[str, Variable]:
    return {
        variable.name: variable for variable in _kind(unit).variables() if variable.causality is Causality.PARAMETER
    }


def _kind(unit: str) -> type[Unit]:
    if unit not in UNITS:
        raise InputError(f"unknown unit '{unit}'{did_you_mean(unit, UNITS)}")
    return UNITS[unit]


def is_memoryless(unit: str) -> bool:
    """Whether a unit's outputs follow its inputs at once, as those of an equilibrium do; InputError if it is none."""
    return _kind(unit).memoryless


def stability_theory(name: str) -> Theory:
    """The theory of stability called so; InputError if there is none."""
    if name not in THEORIES:
        raise InputError(f"unknown theory '{name}'{did_you_mean(name, THEORIES)}")
    return THEORIES[name]


def unit_setting(unit: str, parameters: Parameters) -> Setting:
    """A unit as theories see it, with its defaults."""
    declared = {name: variable.start for name, variable in _declared_parameters(unit).items()}
    return Setting(unit, declared | dict(parameters))


def amplification(theory: Theory, coupled: Coupled) -> float:
    """The factor by which disturbances grow from step to step according to `theory`; NaN where it has no result.

    InputError where the theory does not fit the system.
    """
    try:
        return theory.amplification(coupled)
    except InvalidInput as error:
        raise InputError(str(error)) from None
    except StepFailure:
        return nan


def unit_ports(unit: str, mesh: Mesh, parameters: Parameters) -> tuple[Ports, Ports]:
    """Inputs and outputs of a unit on `mesh`, by name."""
    kind = UNITS[unit]
    given = {variable.name: parameters.get(variable.name, variable.start) for variable in kind.variables()}

    def port(variable: Variable) -> Port:
        return Port(
            variable.name,
            variable.unit,
            variable.shape(mesh),
            variable.location.value,
            variable.fixed,
            variable.needs is None or bool(given[variable.needs]),
            variable.recorded_on(mesh).value,
            variable.needs,
            variable.source.name if isinstance(variable, Statistic) else None,
            stand_in=variable.stand_in,
        )

    inputs = Ports({item.name: port(item) for item in kind.inputs()})
    outputs = Ports({item.name: port(item) for item in kind.outputs()})
    return inputs, outputs


def _parameter_ports(unit: str) -> Ports:
    """The parameters of a unit, those that it computes included, as they are recorded."""
    kinds = {float: "Real", int: "Integer", str: "String"}
    kept = (Causality.PARAMETER, Causality.CALCULATED_PARAMETER)
    declared = (item for item in UNITS[unit].variables() if item.causality in kept)
    return Ports(
        {
            item.name: Port(
                item.name,
                item.unit,
                (),
                fixed=True,
                record="value",
                type=kinds[type(item.start)],
                discrete=not isinstance(item.start, float),
            )
            for item in declared
        }
    )


def element_quality(mesh: Mesh) -> Values:
    """SICN of each tetrahedron, shape (elements,)."""
    return signed_inverse_condition_number(mesh)


def located(mesh: Mesh, points_mm: Sequence[Sequence[float]]) -> Places:
    """Where points lie in `mesh`; InputError for one that lies nowhere."""
    try:
        return Places(mesh, points_mm)
    except InvalidInput as error:
        raise InputError(str(error)) from None


def fmu_of_unit(unit: str, mesh: Mesh, fmu_dir: Path | None, fmi: int = 2) -> Path:
    """The FMU of a unit on `mesh`, of FMI 2.0 or 3.0: from the cache if it is there, built otherwise.

    InputError for a mesh on which its description would be too long.
    """
    try:
        return cached_fmu(UNITS[unit], mesh, fmu_dir, fmi)
    except InvalidInput as error:
        raise InputError(str(error)) from None


class NativeParticipant:
    """A unit called directly."""

    def __init__(
        self,
        name: str,
        unit: str,
        mesh: Mesh,
        parameters: Parameters,
        observe: Sequence[str] = (),
    ) -> None:
        self.name = name
        self.inputs, self.outputs = unit_ports(unit, mesh, parameters)
        every = self.outputs | self.inputs | _parameter_ports(unit)
        # In the order of declaration, as in the unit's FMU.
        known = Ports({variable.name: every[variable.name] for variable in UNITS[unit].variables()})
        self.observed = known.chosen(observe, f"unit '{name}'")
        self._known = known
        self._unit: Unit = UNITS[unit](mesh)
        try:
            self._unit.instantiate(parameters)
        except InvalidInput as error:
            raise InputError(f"unit '{name}': {error}") from None
        self.abilities = Abilities(ramps=UNITS[unit].interpolates, memoryless=UNITS[unit].memoryless)
        self._ramps = Ramps()

    def begin(self) -> None:
        """See Participant."""
        self._unit.setup_experiment()
        self._unit.enter_initialization_mode()

    def complete(self) -> None:
        """See Participant."""
        try:
            self._unit.exit_initialization_mode()
        except InvalidInput as error:
            raise InputError(f"unit '{self.name}': {error}") from None
        except StepFailure as error:
            raise ParticipantError(str(error)) from error

    def set(self, name: str, values: Values) -> None:
        """See Participant."""
        try:
            self._ramps.forget(name)
            if name not in self.inputs:
                name, values = self.inputs.with_element(name, values, self._unit.get)
            self._unit.set(name, values)
        except InvalidInput as error:
            raise ParticipantError(str(error)) from error

    def ramp(self, name: str, ramp: Ramp) -> None:
        """See Participant; the curvature is beyond the units."""
        self._ramps.add(name, ramp)

    def get(self, name: str) -> Values:
        """See Participant."""
        if name not in self._known:
            return self._known.element(name, self.get)
        try:
            values = self._unit.get(name)
        except (InvalidInput, StepFailure) as error:
            raise ParticipantError(str(error)) from error
        return self._ramps.shown(name, self.inputs, np.asarray(values))

    def start(self, time: float, size: float) -> Wait:
        """See Participant; the step is done when this returns."""
        ramps = self._ramps.take()
        try:
            ends = {}
            for name, ramp in whole(ramps, self.inputs, self._unit.get).items():
                self.set(name, ramp.begin)
                ends[name] = ramp.reached(size)
            self._unit.do_step(time, size, ends)
        except (InvalidInput, StepFailure) as error:
            raise ParticipantError(str(error)) from error
        self._ramps.ended(ramps)
        return lambda: None

    def save(self) -> Snapshot:
        """See Participant."""
        return self._unit.get_state()

    def restore(self, state: Snapshot) -> None:
        """See Participant."""
        self._ramps.forget()
        self._unit.set_state(state)

    def free(self, state: Snapshot) -> None:
        """See Participant; nothing is held but by the caller."""

    def pack(self) -> bytes:
        """See Participant."""
        return self._unit.get_state().to_bytes()

    def unpack(self, data: bytes) -> None:
        """See Participant."""
        self._ramps.forget()
        self._unit.set_state(Snapshot.from_bytes(data))

    def implementation(self) -> Implementation:
        """See Participant."""
        return Implementation(self._unit.implementation(), tuple(self._unit.fallbacks()))

    def log_to(self, path: Path) -> None:
        """See Participant; a unit that is called directly logs nothing."""

    def close(self) -> None:
        """See Participant."""
