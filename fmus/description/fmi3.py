"""The modelDescription.xml of a unit's FMI 3.0 FMU, from the unit's own declaration (FMI 3.0, section 2.4).

A field is one Float64 variable with fixed dimensions and one start value for all of its places: only the coordinates
of places make the text longer on a larger mesh.

What depends on what. As in the FMI 2.0 description, `dependencies` names for each output the inputs that a step
carries over to it, and the parameters, which FMI 3.0 counts among what is known; the list is absent where an output
follows all inputs. FMI 3.0 lists whole variables: that a pointwise output follows its inputs at its own place only has
no place in it.
"""

from collections.abc import Iterator

from ...units.mesh import Mesh
from ...units.unit import Unit
from ...units.variable import Causality
from ..annotations import TOOL, annotations
from ..coordinates import Coordinates, coordinates
from ..layout import TIME, Run, layout
from ..xml_tag import tag
from .attributes import is_unknown, measure, number, role, start
from .head import head


def lines(unit: type[Unit], mesh: Mesh, token: str) -> Iterator[str]:
    """The XML text for `unit` on `mesh`; `token` is the instantiation token."""
    runs = layout(unit, mesh)
    yield from head(unit, token, 3)
    yield "<ModelVariables>"
    yield _element(TIME, {"causality": "independent", "variability": "continuous"})
    for run in runs:
        yield _variable(run, unit)
    for known in coordinates(unit, mesh):
        yield _constant(known)
    yield "</ModelVariables>"
    yield "<ModelStructure>"
    for element, found in (("Output", _outputs(runs)), ("InitialUnknown", filter(is_unknown, runs))):
        for run in found:
            yield tag(element, valueReference=str(run.reference), **_dependencies(run, runs), end=True)
    yield "</ModelStructure>"
    yield "<Annotations>"
    yield tag("Annotation", type=TOOL)
    yield from annotations(unit, mesh)
    yield "</Annotation></Annotations>"
    yield "</fmiModelDescription>"


def _element(run: Run, attributes: dict[str, str], nested: str = "") -> str:
    named = {"name": run.variable.name, "valueReference": str(run.reference), **attributes}
    described = {"description": run.variable.description, **measure(run, 3)}
    dimensions = "".join(tag("Dimension", start=str(count), end=True) for count in run.shape)
    return f"{tag(run.type_in(3), **named, **described, end=False)}{dimensions}{nested}</{run.type_in(3)}>"


def _variable(run: Run, unit: type[Unit]) -> str:
    attributes = role(run.variable)
    if run.variable.causality is Causality.INPUT and not run.variable.fixed and unit.interpolates:
        attributes["intermediateUpdate"] = "true"
    if is_unknown(run):
        return _element(run, attributes)
    if run.type_in(3) == "String":
        return _element(run, attributes, tag("Start", value=start(run.variable), end=True))
    return _element(run, attributes | {"start": start(run.variable)})


def _constant(known: Coordinates) -> str:
    values = " ".join(map(number, known.values.tolist()))
    return _element(known, {"causality": "local", "variability": "constant", "start": values})


def _outputs(runs: tuple[Run, ...]) -> list[Run]:
    return [run for run in runs if run.variable.causality is Causality.OUTPUT]


def _dependencies(run: Run, runs: tuple[Run, ...]) -> dict[str, str]:
    inputs = [source for source in runs if source.variable.causality is Causality.INPUT]
    followed = [source for source in inputs if source.variable.name in run.variable.depends_on]
    # Where there are no inputs, an absent list would mean a dependence on the time all the same.
    if len(followed) == len(inputs) > 0:
        return {}
    parameters = [source for source in runs if source.variable.causality is Causality.PARAMETER]
    return {"dependencies": " ".join(str(source.reference) for source in (*followed, *parameters))}
