"""A scenario put together to be shown."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from ..assembly import Assembly, assemble, called_directly, checked_mesh
from ..scenario import Scenario


@contextmanager
def assembled(scenario: Scenario, base: Path, fmu_dir: Path | None = None) -> Iterator[Assembly]:
    """What `scenario` builds, whose paths are relative to `base`; nothing is computed but the mesh.

    InputError for all that is wrong with it.
    """
    mesh = checked_mesh(scenario, base)
    with ExitStack() as stack:
        yield assemble(stack, called_directly(scenario), base, mesh, fmu_dir, described=True)
