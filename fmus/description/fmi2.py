"""The modelDescription.xml of a unit's FMI 2.0 FMU, from the unit's own declaration (FMI 2.0.4, section 2.2).

What depends on what. Outputs change in a step only; `dependencies` therefore names, for each output, the inputs that
the step carries over to it. An output that follows all inputs everywhere has no such attribute, which by the standard
means just that; a pointwise one (active stress) names the inputs at its own place; one without inputs (fibres) has
the empty list. Initial values of outputs may follow everything that is known then. What a unit computes with on the
machine it runs on follows the parameters.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_matrix

from ...units.mesh import Mesh
from ...units.unit import Unit
from ...units.variable import Causality, Location
from ..annotations import TOOL, annotations
from ..layout import Run, layout
from ..xml_tag import tag
from .attributes import is_unknown, measure, role, start
from .head import head


def lines(unit: type[Unit], mesh: Mesh, guid: str) -> Iterator[str]:
    """The XML text for `unit` on `mesh`."""
    runs = layout(unit, mesh)
    yield from head(unit, guid, 2)
    yield "<VendorAnnotations>"
    yield tag("Tool", name=TOOL)
    yield from annotations(unit, mesh)
    yield "</Tool></VendorAnnotations>"
    yield "<ModelVariables>"
    for run in runs:
        yield from _scalars(run)
    yield "</ModelVariables>"
    yield "<ModelStructure>"
    yield "<Outputs>"
    yield from _outputs(runs, mesh)
    yield "</Outputs>"
    yield "<InitialUnknowns>"
    parameters = " ".join(str(_index(run)) for run in runs if run.variable.causality is Causality.PARAMETER)
    for run in filter(is_unknown, runs):
        known = f' dependencies="{parameters}"' if run.variable.causality is Causality.CALCULATED_PARAMETER else ""
        for place in range(run.size):
            yield f'<Unknown index="{_index(run, place)}"{known}/>'
    yield "</InitialUnknowns>"
    yield "</ModelStructure>"
    yield "</fmiModelDescription>"


def _index(run: Run, place: int = 0) -> int:
    """Where a scalar stands among the variables, from 1."""
    return run.first + 1 + place


def _scalars(run: Run) -> Iterator[str]:
    variable = run.variable
    own = tag("ScalarVariable", **role(variable), description=variable.description, end=False)
    given = {} if is_unknown(run) else {"start": start(variable)}
    rest = own.removeprefix("<ScalarVariable") + tag(run.type_in(2), end=True, **given, **measure(run, 2))
    for place, name in enumerate(run.names()):
        yield f'<ScalarVariable name="{name}" valueReference="{run.first + place}"{rest}</ScalarVariable>'


def _outputs(runs: tuple[Run, ...], mesh: Mesh) -> Iterator[str]:
    # In this order their indices are, as the standard wants them, sorted.
    inputs = [run for run in runs if run.variable.causality is Causality.INPUT]
    for run in (run for run in runs if run.variable.causality is Causality.OUTPUT):
        followed = [source for source in inputs if source.variable.name in run.variable.depends_on]
        if not run.variable.pointwise and len(followed) == len(inputs) > 0:
            for place in range(run.size):
                yield f'<Unknown index="{_index(run, place)}"/>'
            continue
        if run.variable.pointwise:
            at = [(source, _places(source, run, mesh)) for source in followed]
        else:
            at = [(source, [list(range(source.size))] * run.size) for source in followed]
        for place in range(run.size):
            known = " ".join(str(_index(source, k)) for source, places in at for k in places[place])
            yield f'<Unknown index="{_index(run, place)}" dependencies="{known}"/>'


def _places(source: Run, target: Run, mesh: Mesh) -> list[list[int]]:
    """For each place of `target`, the places of `source` that lie there."""
    if source.variable.location is target.variable.location:
        return [[place] for place in range(target.size)]
    if (source.variable.location, target.variable.location) != (Location.ELEMENT, Location.NODE):
        raise NotImplementedError(f"pointwise from {source.variable.location} to {target.variable.location}")
    elements = np.repeat(np.arange(mesh.elements), mesh.cells.shape[1])
    around = csr_matrix((np.ones(len(elements)), (mesh.cells.ravel(), elements)), shape=(mesh.nodes, mesh.elements))
    return [row.tolist() for row in np.split(around.indices, around.indptr[1:-1])]
