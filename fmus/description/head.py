"""The begin of a model description, which FMI 2.0 and 3.0 have in one order and almost in the same words."""

from collections.abc import Iterator
from importlib.metadata import metadata

from ...units.unit import Unit
from ..annotations import TOOL
from ..messages import ERROR_CATEGORY, INVALID_INPUT, WARNING_CATEGORY
from ..xml_tag import tag
from .units_of_measure import unit_definitions


def head(unit: type[Unit], token: str, fmi: int) -> Iterator[str]:
    """The lines from the root element to the default experiment; times in s."""
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    known_by = {"guid" if fmi == 2 else "instantiationToken": token}
    yield tag("fmiModelDescription", fmiVersion=f"{fmi}.0", modelName=unit.name, **known_by, **_origin(unit), end=False)
    yield tag("CoSimulation", end=True, modelIdentifier=unit.name, **_capabilities(unit, fmi))
    yield from unit_definitions(unit, *(["s", "mm"] if fmi == 3 else []))
    yield "<LogCategories>"
    yield tag("Category", name=WARNING_CATEGORY, description=f"Messages with the status fmi{fmi}Warning", end=True)
    yield tag("Category", name=ERROR_CATEGORY, description=f"Messages with the status fmi{fmi}Error", end=True)
    yield tag("Category", name=INVALID_INPUT, description="Errors in the arguments of a call", end=True)
    yield "</LogCategories>"
    # A heartbeat in steps of a millisecond.
    yield tag("DefaultExperiment", startTime="0", stopTime="0.32", stepSize="0.001", end=True)


def _origin(unit: type[Unit]) -> dict[str, str]:
    """What the FMU of `unit` is, and what made it."""
    of_tool = metadata(TOOL)
    return {
        "description": (unit.__doc__ or "").splitlines()[0],
        "author": of_tool["Author"],
        "version": of_tool["Version"],
        "license": of_tool["License-Expression"],
        "generationTool": f"{TOOL} {of_tool['Version']}",
        "variableNamingConvention": "structured",
    }


def _capabilities(unit: type[Unit], fmi: int) -> dict[str, str]:
    """FMI 2.0.4, section 4.3.1; FMI 3.0, sections 2.4.2 and 4.4."""
    state = "FMUstate" if fmi == 2 else "FMUState"
    able = ["canHandleVariableCommunicationStepSize", f"canGetAndSet{state}", f"canSerialize{state}"]
    if fmi == 2:
        able.append("canNotUseMemoryManagementFunctions")
    if unit.interpolates:
        able.append("canInterpolateInputs" if fmi == 2 else "providesIntermediateUpdate")
    if unit.differentiable:
        both = ["providesDirectionalDerivatives", "providesAdjointDerivatives"]
        able += ["providesDirectionalDerivative"] if fmi == 2 else both
    unable = ("needsExecutionTool", "canBeInstantiatedOnlyOncePerProcess")
    return dict.fromkeys(unable, "false") | dict.fromkeys(able, "true")
