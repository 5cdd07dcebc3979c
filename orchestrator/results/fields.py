"""fields.h5 with fields.xdmf: all fields every few steps, for ParaView and for reading back.

Layout of the HDF5 file: `points_mm`, `cells`, under `boundaries/` the faces of each named boundary of the mesh by
their nodes (`boundaries`), fixed fields by name (`fiber`, `sheet`), `frames_ms`, and under `frames/` one data set per
field, named with its unit, whose first axis is the frame. `views/<frame>/<field>` are windows on single frames, without
data of their own: what the XDMF file points to, because readers of XDMF disagree about hyperslabs (libxdmf3 takes the
axes in reverse and shows wrong values without an error).

While a run goes on, the frames lie in `fields.parts/`, a file each, and fields.h5 has the same layout, but for the
views, with `frames_ms` and `frames/` mapped onto them: an HDF5 file that is being written to is not readable any more
when its process is killed. It is written once, for HDF5 itself counts the frames that are there; the XDMF file points
to them. In the end all is copied into fields.h5. Of runs with hundreds of frames fields.xdmf is not written anew for
each, which would take a time that grows with the square of their number.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, quoteattr

import h5py
from h5py import h5s

from ..coupling.exchange import Exchange
from ..coupling.master import Accepted
from ..participants.native import Mesh
from ..participants.participant import Participant, Port, Values
from ..writing import remove_stale, writing
from .boundaries import write_boundaries
from .hdf5 import write_mapping, write_streamed
from .names import FIELDS, PARTS, XDMF
from .parts import TIME, Parts, series
from .whole import replacing

#: How XDMF calls the elements, by dimension.
_TOPOLOGIES = {
    0: 'TopologyType="Polyvertex" NodesPerElement="1"',
    1: 'TopologyType="Polyline" NodesPerElement="2"',
    2: 'TopologyType="Triangle"',
    3: 'TopologyType="Tetrahedron"',
}

#: Frames that fields.xdmf may lack while a run goes on, as a fraction of those it has.
_BEHIND = 0.1

_CENTERS = {"node": "Node", "element": "Cell"}


class Fields:
    """Writes a frame at every output time; fields.h5 is complete up to the last at every moment, fields.xdmf nearly.

    `resumed` is the `memory` of an earlier run in the same folder, after whose frames this one goes on; the
    `participants` are initialised then.
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
        self._fixed: dict[str, Values] = {}
        if resumed is not None:
            # What the units made of the same scenario again; it need not be in every checkpoint.
            fixed = [(name, unit, port) for name, unit, port in self._named if port.fixed]
            self._fixed = {name: participants[unit].get(port.name) for name, unit, port in fixed}
        # Whether fields.h5 refers to the frames, and to how many fields.xdmf does.
        self._refers = False
        # What fields.xdmf says of each frame so far, whose changing fields lie at this place.
        self._place = ""
        self._grids: list[str] = []
        self._listed = len(self._parts.times)
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
            if not self._refers:
                self._write(self._refer)
                self._refers = True
            if len(self._parts.times) >= (1.0 + _BEHIND) * self._listed:
                self._write_xdmf(f"{self._parts.folder.name}/{{frame}}.h5:/{{name}}")

    def memory(self) -> dict[str, Any]:
        """For a checkpoint."""
        return {"frames": len(self._parts.times)}

    def close(self) -> None:
        """Gather all frames in fields.h5; the parts stay, to go on from a checkpoint."""
        if self._open:
            self._write(self._copy)
            if self._parts.times:
                self._write_xdmf(f"{FIELDS}:/views/{{frame}}/{{name}}")
        self._open = False

    def forget(self) -> None:
        """Remove the parts: after `close`, when there is nothing to go on from."""
        self._parts.remove()

    def _write(self, add_frames: Callable[[h5py.File], None]) -> None:
        """Write fields.h5 anew, with the frames added, and replace the old one by it."""

        def fill(file: h5py.File) -> None:
            file["points_mm"] = self._mesh.points
            file["cells"] = self._mesh.cells
            write_boundaries(file, self._mesh.boundaries)
            for name, values in self._fixed.items():
                file[name] = values
            add_frames(file)

        write_streamed(self._path, fill)

    def _refer(self, file: h5py.File) -> None:
        folder = self._parts.folder.name
        series(file, "frames_ms", folder, TIME, ())
        frames = file.create_group("frames")
        for name, shape in self._moving():
            series(frames, name, folder, name, shape)

    def _copy(self, file: h5py.File) -> None:
        file["frames_ms"] = self._parts.times
        count = len(self._parts.times)
        frames = file.create_group("frames")
        chunked = []
        for name, shape in self._moving():
            whole = (count, *shape)
            data = frames.create_dataset(name, whole, maxshape=(None, *shape), chunks=(1, *shape), dtype="f8")
            chunked.append((name, [0] * len(shape), data.id, Windows(name, whole)))
        for frame, numbers in enumerate(self._parts.numbers([name for name, _ in self._moving()])):
            view = file.create_group(f"views/{frame}")
            for name, corner, data, windows in chunked:
                data.write_direct_chunk((frame, *corner), numbers[name])
                windows.add(view, frame)

    def _moving(self) -> list[tuple[str, tuple[int, ...]]]:
        return [(name, port.shape) for name, _, port in self._named if not port.fixed]

    def _write_xdmf(self, place: str) -> None:
        """Write fields.xdmf, whose changing fields lie at `place`, a format of the frame and the name.

        Only what it says of frames that are new there is made.
        """
        if place != self._place:
            self._place, self._grids = place, []
        begun = len(self._grids)
        self._grids += [self._grid(begun + frame, time) for frame, time in enumerate(self._parts.times[begun:])]
        self._listed = len(self._grids)
        lines = ["<?xml version='1.0' encoding='utf-8'?>", '<Xdmf Version="3.0">', "<Domain>"]
        lines.append('<Grid GridType="Collection" CollectionType="Temporal">')
        lines += [*self._grids, "</Grid>", "</Domain>", "</Xdmf>", ""]
        with replacing(self._xdmf) as part:
            part.write_text("\n".join(lines), encoding="utf-8")

    def _grid(self, frame: int, time: float) -> str:
        mesh = self._mesh
        lines = [
            '<Grid Name="mesh">',
            f'<Time Value="{time!r}" />',
            f'<Topology NumberOfElements="{mesh.elements}" {_TOPOLOGIES[mesh.dimension]}>',
            _item(f"{FIELDS}:/cells", mesh.cells.shape, "Int"),
            "</Topology>",
            '<Geometry GeometryType="XYZ">',
            _item(f"{FIELDS}:/points_mm", mesh.points.shape, "Float"),
            "</Geometry>",
        ]
        for name, _, port in self._named:
            kind = "Scalar" if len(port.shape) == 1 else "Vector"
            center = _CENTERS[str(port.location)]
            lines.append(f'<Attribute Name={quoteattr(name)} AttributeType="{kind}" Center="{center}">')
            where = f"{FIELDS}:/{name}" if port.fixed else self._place.format(frame=frame, name=name)
            lines += [_item(where, port.shape, "Float"), "</Attribute>"]
        return "\n".join([*lines, "</Grid>"])


def _item(place: str, shape: tuple[int, ...], kind: str) -> str:
    dimensions = " ".join(map(str, shape))
    return (
        f'<DataItem Dimensions="{dimensions}" NumberType="{kind}" Precision="8" Format="HDF">{escape(place)}</DataItem>'
    )


class Windows:
    """Data sets `name` without data of their own: each one frame of the series of that name and `shape`."""

    def __init__(self, name: str, shape: tuple[int, ...]) -> None:
        self._name, self._shape = name, shape
        self._path = f"/frames/{name}".replace("%", "%%")
        self._series, self._space = h5s.create_simple(shape), h5s.create_simple(shape[1:])

    def add(self, group: h5py.Group, frame: int) -> None:
        """Add the window on `frame` to `group`."""
        self._series.select_hyperslab((frame, *[0] * (len(self._shape) - 1)), (1, *self._shape[1:]))
        write_mapping(group, self._name, self._space, ".", self._path, self._series)


def _named(participants: Mapping[str, Participant]) -> list[tuple[str, str, Port]]:
    """Data set name, unit and port of every live field on the mesh; units that share a name are told apart."""
    ports = [
        (unit, port)
        for unit, participant in participants.items()
        for port in participant.outputs.values()
        if port.location in _CENTERS and port.live
    ]
    names = [port.column for _, port in ports]
    return [
        (f"{unit}.{port.column}" if names.count(port.column) > 1 else port.column, unit, port) for unit, port in ports
    ]
