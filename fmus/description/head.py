"""What the model descriptions of FMI 2.0 and of FMI 3.0 say of an FMU in the same words."""

from collections.abc import Iterator
from importlib.metadata import version

from ...units.unit import Unit
from ..annotations import TOOL
from ..messages import ERROR_CATEGORY, INVALID_INPUT, WARNING_CATEGORY
from ..xml_tag import tag


def origin(unit: type[Unit]) -> dict[str, str]:
    """Attributes of the root: what the FMU of `unit` is, and what made it."""
    return {
        "description": (unit.__doc__ or "").splitlines()[0],
        "version": version(TOOL),
        "license": "BSD-3-Clause",
        "generationTool": f"{TOOL} {version(TOOL)}",
        "variableNamingConvention": "structured",
    }


def log_categories(fmi: int) -> Iterator[str]:
    """The element LogCategories, for the statuses of FMI 2 or 3."""
    yield "<LogCategories>"
    yield tag("Category", name=WARNING_CATEGORY, description=f"Messages with the status fmi{fmi}Warning", end=True)
    yield tag("Category", name=ERROR_CATEGORY, description=f"Messages with the status fmi{fmi}Error", end=True)
    yield tag("Category", name=INVALID_INPUT, description="Errors in what the caller gave", end=True)
    yield "</LogCategories>"


def default_experiment() -> str:
    """A heartbeat in steps of a millisecond; times in s."""
    return tag("DefaultExperiment", startTime="0", stopTime="0.32", stepSize="0.001", end=True)
