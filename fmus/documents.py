"""What an FMU says of itself beside its description: documentation, needs, terminals, licence, citation and icon.

FMI 2.0.4, section 2.3; FMI 3.0, sections 2.5.1 and 2.4.9. The texts are Jinja templates (`templates`), filled from the
unit's declarations and docstrings. In FMI 3.0 every field is a terminal, and so are all inputs and all outputs; the
fields of one number at a place are besides maps from the places' coordinates (FMI-LS-STRUCT 1.0.0-rc.1).
"""

import re
import sys
from functools import cache
from importlib.metadata import distribution, metadata, requires
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING

from ruamel.yaml import YAML

from ..units.mesh import Mesh
from ..units.unit import Unit
from ..units.variable import Causality, Location, Variable
from .annotations import TOOL
from .coordinates import coordinates

if TYPE_CHECKING:
    from jinja2 import Environment

#: What an FMU imports beyond Python itself.
PACKAGES = ("numpy", "scipy", "scikit-fem")

_OWN = Path(__file__).parent
_STRUCT = "org.fmi-standard.fmi-ls-struct"


def documents(unit: type[Unit], mesh: Mesh, fmi: int) -> dict[str, bytes]:
    """The files of the FMU of `unit` on `mesh` that are for people and for tools' pictures, by their paths in it."""
    found = {
        "documentation/licenses/license.txt": shipped("LICENSE").encode(),
        "documentation/CITATION.cff": shipped("CITATION.cff").encode(),
    }
    templates = {"documentation/index.html": "documentation.html"}
    templates["documentation/externalDependencies.txt"] = "externalDependencies.txt"
    places = coordinates(unit, mesh) if fmi == 3 else ()
    if fmi == 2:
        found["model.png"] = (_OWN / "icon.png").read_bytes()
    else:
        found |= {f"terminalsAndIcons/{name}": (_OWN / name).read_bytes() for name in ("icon.png", "icon.svg")}
        templates["terminalsAndIcons/terminalsAndIcons.xml"] = "terminalsAndIcons.xml"
    if places:
        templates[f"extra/{_STRUCT}/fmi-ls-manifest.xml"] = "fmi-ls-manifest.xml"
    summary, *further = cleandoc(unit.__doc__ or "").split("\n\n")
    known = {
        "unit": unit,
        "mesh": mesh,
        "fmi": fmi,
        "coordinates": places,
        "struct": _STRUCT,
        "summary": summary,
        "paragraphs": [*(sys.modules[unit.__module__].__doc__ or "").split("\n\n"), *further],
        "groups": {kind.value: _rows(unit, mesh, kind) for kind in Causality},
        "packages": [each for each in requires(TOOL) or () if re.split(r"[^\w-]", each)[0] in PACKAGES],
        "references": YAML(typ="safe").load(shipped("CITATION.cff"))["references"],
        "tool": metadata(TOOL),
    }
    return found | {path: rendered(name, **known) for path, name in templates.items()}


def shipped(name: str) -> str:
    """A file of the project's root, in a checkout or as it was installed with the package."""
    checkout = _OWN.parent / name
    text = checkout.read_text("utf-8") if checkout.is_file() else distribution(TOOL).read_text(f"licenses/{name}")
    if text is None:
        raise FileNotFoundError(f"the installed package {TOOL} lacks its file {name}; install it again")
    return text


def notes(variable: Variable) -> str:
    """What else there is to know of an input or output, in brackets; empty if nothing is."""
    found = ["once, at initialisation"] if variable.fixed else []
    found += [f"only where `{variable.needs}` is not 0"] if variable.needs else []
    return f" ({', '.join(found)})" if found else ""


def limits(variable: Variable) -> str:
    """The values that a variable may have."""
    if variable.choices:
        return ", ".join(f"`{choice}`" for choice in variable.choices)
    bounds = ((">", variable.above), ("≥", variable.at_least), ("<", variable.below))
    return ", ".join(f"{sign} {bound:g}" for sign, bound in bounds if bound is not None)


def shape(variable: Variable, nodes: object = "nodes", elements: object = "elements") -> str:
    """How many values a variable has, by the mesh's numbers of `nodes` and `elements`."""
    place = {Location.GLOBAL: "", Location.NODE: f"{nodes}", Location.ELEMENT: f"{elements}"}[variable.location]
    return "scalar" if not place else place if variable.components == 1 else f"{place} × {variable.components}"


def _rows(unit: type[Unit], mesh: Mesh, causality: Causality) -> list[dict[str, str]]:
    """The table of the variables of a `causality`."""
    return [_row(item, mesh) for item in unit.variables() if item.causality is causality]


def _row(item: Variable, mesh: Mesh) -> dict[str, str]:
    """A line of the table of its causality, by columns."""
    row = {"name": f"`{item.name}`", "unit of measure": "" if item.unit == "1" else item.unit}
    if item.causality in (Causality.INPUT, Causality.OUTPUT):
        row["values"] = shape(item, f"{mesh.nodes} nodes", f"{mesh.elements} elements")
    if item.causality in (Causality.INPUT, Causality.PARAMETER):
        row |= {"start": str(item.start), "limits": limits(item)}
    return row | {"description": item.description + (notes(item) if "values" in row else "")}


def rendered(template: str, **known: object) -> bytes:
    """The file `template` among the templates, filled with what is `known`."""
    return _templates().get_template(template).render(known).encode()


@cache
def _templates() -> "Environment":
    # Imported here: who builds no FMU, because it is there already, need not wait for it.
    from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
    from markupsafe import Markup, escape

    loader = FileSystemLoader(_OWN / "templates")
    found = Environment(loader=loader, autoescape=select_autoescape(), undefined=StrictUndefined)
    found.trim_blocks = found.lstrip_blocks = found.keep_trailing_newline = True
    found.filters["coded"] = lambda text: Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))
    return found
