"""fields.h5 with fields.xdmf: all fields every few steps, for ParaView and for reading back.

Layout of the HDF5 file: `points_mm`, `cells`, fixed fields by name (`fiber`, `sheet`), `frames_ms`, and under
`frames/` one data set per field, named with its unit, whose first axis is the frame. `views/<frame>/<field>` are
windows on single frames, without data of their own: what the XDMF file points to, because readers of XDMF disagree
about hyperslabs (libxdmf3 takes the axes in reverse and shows wrong values without an error).

While a run goes on, the frames lie in `fields.parts/`, a file each, and fields.h5 has the same layout with references
to them: an HDF5 file that is being written to is not readable any more when its process is killed. In the end all is
copied into fields.h5. Of runs with hundreds of frames it is not written anew for each, which would take a time that
grows with the square of their number.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import h5py

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..participants.native import Mesh
from ..participants.participant import Participant, Port, Values
from ..writing import remove_stale, writing
from .hdf5 import write_streamed
from .names import FIELDS, PARTS, XDMF
from .parts import Parts
from .whole import replacing

#: How XDMF calls the elements, by dimension.
_TOPOLOGIES = {
    0: {"TopologyType": "Polyvertex", "NodesPerElement": "1"},
    1: {"TopologyType": "Polyline", "NodesPerElement": "2"},
    2: {"TopologyType": "Triangle"},
    3: {"TopologyType": "Tetrahedron"},
}

#: Frames that fields.h5 may lack while a run goes on, as a fraction of those it has.
_BEHIND = 0.1

_CENTERS = {"node": "Node", "element": "Cell"}


class Fields:
    """Writes a frame at every output time; both files are complete up to the last frame, or nearly, at every moment.

    `resumed` is the `memory` of an earlier run in the same folder, after whose frames this one goes on.
    """

    def __init__(
        self,
        folder: Path,
        participants: Mapping[str, Participant],
        mesh: Mesh,
        resumed: Mapping[str, Any] | None = None,
    ) -> None:
        self._open = True
        self._named = _named(participants)
        self._mesh = mesh
        self._path, self._xdmf = folder / FIELDS, folder / XDMF
        if resumed is None:
            remove_stale(self._xdmf)
        self._parts = Parts(folder / PARTS, 0 if resumed is None else int(resumed["frames"]))
        self._fixed: dict[str, Values] = {} if resumed is None else dict(resumed.get("fixed", {}))
        # How many frames fields.h5 has or refers to.
        self._referred = len(self._parts.times)
        if resumed is None:
            with writing(self._path):
                self._write(self._copy)

    def accept(self, step: Accepted, exchange: Exchange) -> None:
        """See Observer."""
        if step.number == 0:
            self._fixed = {name: exchange.value(unit, port.name) for name, unit, port in self._named if port.fixed}
        if step.is_output:
            # All values are at hand before the first is written: a unit that fails here leaves no half a frame.
            values = {name: exchange.value(unit, port.name) for name, unit, port in self._named if not port.fixed}
            self._parts.add(step.time_ms, values)
            if len(self._parts.times) >= (1.0 + _BEHIND) * self._referred:
                self._write(self._refer)
                self._write_xdmf()

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {"frames": len(self._parts.times), "fixed": self._fixed}

    def close(self) -> None:
        """Gather all frames in fields.h5; the parts stay, to go on from a checkpoint."""
        if self._open:
            self._write(self._copy)
            if self._parts.times:
                self._write_xdmf()
        self._open = False

    def forget(self) -> None:
        """Remove the parts: after `close`, when there is nothing to go on from."""
        self._parts.remove()

    def _write(self, add_frames: Callable[[h5py.File], None]) -> None:
        """Write fields.h5 anew, with the frames added, and replace the old one by it."""
        self._referred = len(self._parts.times)

        def fill(file: h5py.File) -> None:
            file["points_mm"] = self._mesh.points
            file["cells"] = self._mesh.cells
            file["frames_ms"] = self._parts.times
            for name, values in self._fixed.items():
                file[name] = values
            add_frames(file)

        write_streamed(self._path, fill)

    def _refer(self, file: h5py.File) -> None:
        count = len(self._parts.times)
        for name, shape in self._moving():
            series = _layout((count, *shape))
            for frame in range(count):
                path = self._parts.path(frame)
                reference = f"{path.parent.name}/{path.name}"
                series[frame] = h5py.VirtualSource(reference, name, shape, "f8")
                file[f"views/{frame}/{name}"] = h5py.ExternalLink(reference, name)
            file.create_virtual_dataset(f"frames/{name}", series)

    def _copy(self, file: h5py.File) -> None:
        count = len(self._parts.times)
        for name, shape in self._moving():
            series = file.create_dataset(
                f"frames/{name}", (count, *shape), maxshape=(None, *shape), chunks=(1, *shape), dtype="f8"
            )
            for frame in range(count):
                window = _layout(shape)
                window[...] = h5py.VirtualSource(".", f"frames/{name}", series.shape)[frame]
                file.create_virtual_dataset(f"views/{frame}/{name}", window)
        for frame in range(count):
            with self._parts.open(frame) as part:
                for name, _ in self._moving():
                    file[f"frames/{name}"][frame] = part[name][...]

    def _moving(self) -> list[tuple[str, tuple[int, ...]]]:
        return [(name, port.shape) for name, _, port in self._named if not port.fixed]

    def _write_xdmf(self) -> None:
        root = Element("Xdmf", Version="3.0")
        series = SubElement(SubElement(root, "Domain"), "Grid", GridType="Collection", CollectionType="Temporal")
        for frame, time in enumerate(self._parts.times):
            grid = SubElement(series, "Grid", Name="mesh")
            SubElement(grid, "Time", Value=repr(time))
            elements = {"NumberOfElements": str(self._mesh.elements)}
            topology = SubElement(grid, "Topology", elements | _TOPOLOGIES[self._mesh.dimension])
            self._item(topology, "cells", self._mesh.cells.shape, "Int")
            self._item(SubElement(grid, "Geometry", GeometryType="XYZ"), "points_mm", self._mesh.points.shape, "Float")
            for name, _, port in self._named:
                kind = "Scalar" if len(port.shape) == 1 else "Vector"
                attribute = SubElement(
                    grid, "Attribute", Name=name, AttributeType=kind, Center=_CENTERS[str(port.location)]
                )
                self._item(attribute, name if port.fixed else f"views/{frame}/{name}", port.shape, "Float")
        tree = ElementTree(root)
        indent(tree)
        with replacing(self._xdmf) as part:
            tree.write(part, encoding="utf-8", xml_declaration=True)

    def _item(self, parent: Element, name: str, shape: tuple[int, ...], kind: str) -> None:
        dimensions = " ".join(map(str, shape))
        item = SubElement(parent, "DataItem", Dimensions=dimensions, NumberType=kind, Precision="8", Format="HDF")
        item.text = f"fields.h5:/{name}"


def _layout(shape: tuple[int, ...]) -> h5py.VirtualLayout:
    layout = h5py.VirtualLayout(shape, "f8")
    # A run and its repetition are to be the same file: no data set remembers when it was made.
    layout.dcpl.set_obj_track_times(False)
    return layout


def _named(participants: Mapping[str, Participant]) -> list[tuple[str, str, Port]]:
    """Data set name, unit and port of every field on the mesh; units that share a name are told apart."""
    ports = [
        (unit, port)
        for unit, participant in participants.items()
        for port in participant.outputs.values()
        if port.location in _CENTERS
    ]
    names = [port.column for _, port in ports]
    return [
        (f"{unit}.{port.column}" if names.count(port.column) > 1 else port.column, unit, port) for unit, port in ports
    ]
