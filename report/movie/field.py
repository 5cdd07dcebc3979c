"""The field that a movie shows: a number at each node in every frame."""

from dataclasses import dataclass

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from ...orchestrator.errors import InputError, did_you_mean
from ...orchestrator.participants.participant import Values
from ...orchestrator.results.comparison import spoken, stem_of, unit_of
from ...orchestrator.results.stored_run import StoredRun
from ..figures.tissue import nodal_mean

#: Shown if nobody asks for another one, the first that the run has.
_PREFERRED = ("potential_mV", "active_stress_kPa", "stretch")

#: A field of the times of events has no value where nothing has happened yet.
_EVENTS = "_time_ms"

_PALETTE = "viridis"


@dataclass(frozen=True)
class MovieField:
    """A field of `run` that changes, by its name in fields.h5."""

    run: StoredRun
    name: str

    @classmethod
    def of(cls, run: StoredRun, asked: str | None) -> "MovieField":
        """The field that was `asked` for, with or without its unit of measure, or the first that one looks at.

        InputError, with those that there are, where the run has no such field of numbers.
        """
        nodes, elements = (0 if array is None else len(array) for array in (run.points_mm, run.cells))
        shapes = {name: run.frame(name, 0) for name in run.moving if not name.endswith(_EVENTS)}
        known = {
            name: stem_of(name)
            for name, values in shapes.items()
            if values is not None and values.shape in ((nodes,), (elements,))
        }
        if not known:
            raise InputError(f"{run.folder}: the run stored no field that changes, so there is nothing to film")
        if asked is None:
            return cls(run, next((name for name in _PREFERRED if name in known), next(iter(known))))
        for name, stem in known.items():
            if asked in (name, stem):
                return cls(run, name)
        hint = did_you_mean(asked, known.values())
        raise InputError(f"--field {asked}: the run has no such field{hint}; choose one of {', '.join(known.values())}")

    @property
    def label(self) -> str:
        """For the colour bar, with the unit of measure."""
        unit = unit_of(self.name)
        stem = spoken(self.name)
        return f"{'transmembrane ' * (stem == 'potential')}{stem} ({unit or '1'})"

    def at(self, frame: int) -> Values:
        """The values at the nodes, shape (nodes,); of a field of the elements the means around each node."""
        values = self.run.frame(self.name, frame)
        if values is None:
            raise KeyError(self.name)
        points, mesh = self.run.points_mm, self.run.mesh
        if points is None or len(values) == len(points) or mesh is None:
            return values
        return np.asarray(nodal_mean(mesh, values[:, None])[:, 0])

    def colors(self) -> ScalarMappable:
        """The same in all frames."""
        ends = [(values.min(), values.max()) for values in map(self.at, range(len(self.run.frames_ms)))]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        # A body at rest has one value; the colour bar still needs two ends.
        return ScalarMappable(Normalize(low, high if high > low else low + 1.0), _PALETTE)
