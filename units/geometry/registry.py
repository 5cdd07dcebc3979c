"""The anatomies by name; a new one is a file in this folder and a line in `GEOMETRIES`."""

import difflib
from collections.abc import Callable
from pathlib import Path

from ..errors import InvalidInput
from ..mesh import Mesh
from ..mesh.file import read_mesh
from .biventricle import Biventricle
from .grid import cell, sheet, slab, strand
from .left_ventricle import LeftVentricle

#: For each name the recipe that makes its mesh from the element size in mm.
GEOMETRIES: dict[str, Callable[[float], Mesh]] = {
    "biventricle": Biventricle().mesh,
    "cell": cell,
    "left_ventricle": LeftVentricle().mesh,
    "sheet": sheet,
    "slab": slab,
    "strand": strand,
}

#: Meshes that come with the package, made by their recipe, so that the baseline runs where gmsh does not.
SHIPPED = {
    ("biventricle", 5.0): Path(__file__).with_name("biventricle_5mm.msh"),
}


def build(name: str, size_mm: float) -> Mesh:
    """The mesh of the anatomy `name` with elements of about `size_mm`.

    Raises
    ------
    InvalidInput
        For an unknown name or a size its recipe cannot work with.
    """
    if name not in GEOMETRIES:
        near = difflib.get_close_matches(name, GEOMETRIES, n=1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise InvalidInput(f"unknown geometry '{name}' (known: {', '.join(sorted(GEOMETRIES))}){hint}")
    shipped = SHIPPED.get((name, size_mm))
    return GEOMETRIES[name](size_mm) if shipped is None else read_mesh(shipped)
