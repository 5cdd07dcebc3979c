"""The module of a unit that is no part of this project: what its FMU has to carry besides the project's code.

The module is written as any other that uses the project: it imports from `cardiac_cosim.units`. In the FMU the
project's code has a name that is the FMU's own, so these imports are made relative to it there.
"""

import ast
import inspect
import sys
from pathlib import Path

from ..units import registry
from ..units.errors import InvalidInput
from ..units.unit import Unit

#: What the module is called in the package that an FMU carries.
NAME = "own_unit"

#: The package of the units, and that which it is a part of, as other people import them.
_UNITS = registry.__name__.rpartition(".")[0]
_PROJECT = _UNITS.rpartition(".")[0]


def is_own(unit: type[Unit]) -> bool:
    """Whether `unit` comes from outside of this project."""
    return not unit.__module__.startswith(f"{_UNITS}.")


def own_module(unit: type[Unit]) -> dict[str, bytes]:
    """The module of `unit` by its path in the package of its FMU; nothing where the project has the unit.

    InvalidInput where the unit is in no file, is inside of another class or function, or imports what an FMU has not.
    """
    if not is_own(unit):
        return {}
    file = getattr(sys.modules.get(unit.__module__), "__file__", None)
    if file is None or unit.__qualname__ != unit.__name__:
        raise InvalidInput(
            f"the unit '{unit.name}' cannot be carried by an FMU, because its class {unit.__qualname__} is not defined "
            "at the top of a file; write it into a file of its own"
        )
    text = Path(inspect.getsourcefile(unit) or file).read_text(encoding="utf-8")
    return {f"{NAME}.py": _made_relative(text, file).encode()}


def _made_relative(text: str, file: str) -> str:
    """`text` with the imports from the units relative to the package that an FMU carries."""
    lines = text.splitlines(keepends=True)
    for node in ast.walk(ast.parse(text, file)):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and _is_in(node.module, _UNITS):
            place = node.lineno - 1
            lines[place] = lines[place].replace(f"from {_PROJECT}.", "from .", 1)
        elif isinstance(node, ast.Import | ast.ImportFrom) and any(_is_in(name, _PROJECT) for name in _imported(node)):
            raise InvalidInput(
                f"{file}, line {node.lineno}: an FMU cannot carry this import; write `from {_UNITS}.<module> import "
                "<name>`, and what builds the FMU into another file"
            )
    return "".join(lines)


def _imported(node: ast.Import | ast.ImportFrom) -> list[str]:
    """The modules that a statement imports."""
    if isinstance(node, ast.Import):
        return [name.name for name in node.names]
    return [node.module or ""] if node.level == 0 else []


def _is_in(module: str | None, package: str) -> bool:
    return module is not None and f"{module}.".startswith(f"{package}.")
