"""`cosim show`: what a scenario builds, exchanges and solves, before anything runs; and what it does without."""

from collections.abc import Iterator, Mapping, Sequence
from math import ceil

import numpy as np

from ..assembly import Assembly
from ..coupling.build import idle
from ..coupling.connections import Connection
from ..coupling.loops import groups_in_order
from ..coupling.master import stepping_order
from ..omissions import driven_inputs, omissions
from ..participants.native import Mesh, element_quality
from ..participants.participant import Participant
from ..scenario import Scenario

#: 10–90 % width of a depolarising front in mm (docs/model.md, Numbers); elements longer than half of it are too coarse.
_FRONT_MM = 7.9
#: How long an upstroke takes in ms on the way from rest to its peak.
_UPSTROKE_MS = 15.0

_ELEMENTS = {0: "points", 1: "lines", 2: "triangles", 3: "tetrahedra"}


def describe(assembly: Assembly) -> str:
    """The text for a person: mesh, units, connections, loops, order, exchange, what is not modelled, warnings."""
    scenario, mesh, participants = assembly.scenario, assembly.mesh, assembly.participants
    connections = assembly.connections
    order = stepping_order(participants, scenario.coupling.order)
    parts = {
        "mesh": [] if mesh is None or scenario.scene is None else list(_mesh(mesh, scenario.scene.refine)),
        "units": list(_units(scenario, participants)),
        "connections": [str(link) + _fixed(link, participants) for link in connections] or ["none"],
        "signals": list(_driven(scenario, participants)),
        "loops": _loops(order, connections) or ["none: one ordered sweep is exact, there is nothing to iterate"],
        "order": [" -> ".join(order)],
        "convergence": [f"{name}: {criterion}" for name, criterion in assembly.converged.items()],
        "exchange": [
            *_exchange(scenario, participants, connections, order),
            *_held(scenario, participants, connections, order),
        ],
        "not modelled": omissions(participants, connections) or ["nothing is left out"],
        "warnings": [*assembly.warnings, *_warnings(scenario, mesh)] or ["none"],
    }
    lines = [scenario.name]
    for title, content in parts.items():
        lines += [f"\n{title}", *(f"  {line}" for line in content)] if content else []
    return "\n".join(lines)


def _mesh(mesh: Mesh, levels: int) -> Iterator[str]:
    yield f"{mesh.nodes} nodes, {mesh.elements} {_ELEMENTS[mesh.dimension]}"
    if mesh.dimension and levels:
        coarse = mesh.elements // 2 ** (mesh.dimension * levels)
        yield f"nested refinement of {coarse} {_ELEMENTS[mesh.dimension]}, {levels} level{'s' if levels > 1 else ''}"
    if mesh.dimension == 3:
        quality = element_quality(mesh)
        yield f"volume {mesh.volumes.sum() / 1000.0:.2f} ml, SICN {quality.min():.2f} to {quality.max():.2f}"
    if mesh.dimension:
        edges = _edges(mesh)
        yield f"edges {edges.min():.2f} to {edges.max():.2f} mm, mean {edges.mean():.2f} mm"
    for name, faces in mesh.boundaries.items():
        yield f"boundary {name}: {len(faces)} faces"


def _units(scenario: Scenario, participants: Mapping[str, Participant]) -> Iterator[str]:
    for name, participant in participants.items():
        entry = scenario.units[name]
        yield f"{name}: {entry.unit or entry.fmu}"
        for title, ports in (("in ", participant.inputs), ("out", participant.outputs)):
            for port in ports.values():
                shape = " × ".join(map(str, port.shape)) or "scalar"
                unit = "" if port.unit in (None, "1") else f" {port.unit}"
                yield f"  {title} {port.name}{unit}, {shape}{' (once)' if port.fixed else ''}"


def _loops(order: Sequence[str], connections: Sequence[Connection]) -> list[str]:
    return [" <-> ".join(group.units) for group in groups_in_order(order, connections) if len(group.units) > 1]


def _held(
    scenario: Scenario,
    participants: Mapping[str, Participant],
    connections: Sequence[Connection],
    order: Sequence[str],
) -> Iterator[str]:
    """The inputs that are held although the scenario asks for linear ones."""
    if scenario.coupling.interpolation != "linear":
        return
    for link in connections:
        abilities = participants[link.target.unit].abilities
        moves = link.target.unit in order and not _fixed(link, participants)
        if moves and not abilities.ramps and not abilities.memoryless:
            yield (
                f"{link.target}: held over every step, although `interpolation: linear` is asked for, because the unit "
                "cannot follow an input inside a step; the coupling is of first order there"
            )


def _exchange(
    scenario: Scenario,
    participants: Mapping[str, Participant],
    connections: Sequence[Connection],
    order: Sequence[str],
) -> Iterator[str]:
    moving = [link for link in connections if not _fixed(link, participants)]
    numbers = sum(participants[link.source.unit].outputs[link.source.name].size for link in moving)
    yield f"{numbers} numbers in {len(moving)} fields at every exchange"
    outputs = ceil(scenario.run.stop_ms / scenario.output.every_ms - 1e-9)
    lazy = idle(participants, connections)
    if scenario.coupling.adaptive is not None:
        yield f"steps of {scenario.coupling.adaptive.min_ms:g} to {scenario.coupling.adaptive.max_ms:g} ms, as needed"
        return
    steps = round(scenario.run.stop_ms / scenario.coupling.step_ms)
    for unit in order:
        every = scenario.units[unit].every
        count = outputs if unit in lazy else max(ceil(steps / every), 1)
        saved = "" if count >= steps else f", {steps - count} fewer than exchanges"
        why = "; nothing is fed by it between outputs" if unit in lazy and count < steps else ""
        yield f"{unit}: {count} solves{saved}{why}"


def _driven(scenario: Scenario, participants: Mapping[str, Participant]) -> Iterator[str]:
    for name, signals in driven_inputs(participants).items():
        for signal in signals:
            yield f"{scenario.inputs.file if scenario.inputs else ''} -> {name}.{signal}"


def _warnings(scenario: Scenario, mesh: Mesh | None) -> Iterator[str]:
    if mesh is not None and mesh.dimension and scenario.scene is not None:
        longest = float(_edges(mesh).mean())
        if longest > _FRONT_MM / 2.0:
            yield (
                f"elements of {longest:.1f} mm are coarse against a depolarising front of {_FRONT_MM:g} mm: "
                "waves are too fast (consistent mass) or too slow (lumped); "
                f"compare with scene.refine: {scenario.scene.refine + 1}"
            )
    coupling = scenario.coupling
    if mesh is not None and coupling.adaptive is None and coupling.step_ms > _UPSTROKE_MS:
        yield f"coupling.step_ms of {coupling.step_ms:g} ms is longer than an upstroke of {_UPSTROKE_MS:g} ms"


def _edges(mesh: Mesh) -> np.ndarray:
    corners = mesh.points[mesh.cells]
    count = mesh.dimension + 1
    pairs = [(one, other) for one in range(count) for other in range(one)]
    return np.concatenate([np.linalg.norm(corners[:, one] - corners[:, other], axis=1) for one, other in pairs])


def _fixed(link: Connection, participants: Mapping[str, Participant]) -> str:
    source = participants[link.source.unit].outputs[link.source.name]
    target = participants[link.target.unit].inputs[link.target.name]
    return " (once)" if source.fixed or target.fixed else ""
