"""Linear and quadratic displacement on a contracted heart, on refined meshes: writes a table in docs/mechanics.md."""

from time import process_time

import numpy as np
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mesh.refinement import refined

from .land import PAGE
from .page import write_between
from .refinement import started

_SIZE_MM = 8.0
#: The plateau of the active stress.
_STRESS_KPA = 500.0
#: Polynomial order of the displacement, and levels of refinement.
_CASES = ((1, 0), (1, 1), (1, 2), (2, 0), (2, 1))


def measure() -> str:
    """The table; all meshes are nested in the first and inherit its fibres."""
    heart = build("biventricle", _SIZE_MM)
    generator = started(FiberGenerator(heart), {}, {})
    rows = [
        "| displacement | refinements | tetrahedra | left ventricle, ml | right ventricle, ml | apex uplift, mm "
        "| relative time |",
        "|---|---|---|---|---|---|---|",
    ]
    first = None
    for order, levels in _CASES:
        fine = refined(heart, levels)
        directions = {name: generator.get(name)[fine.parents] for name in ("fiber", "sheet")}
        unit = started(Mechanics(fine.mesh), {"element_order": order}, directions)
        unit.set("active_stress", np.full(fine.mesh.nodes, _STRESS_KPA))
        begin = process_time()
        unit.do_step(0.0, 0.001)
        took = process_time() - begin
        first = first or took
        left, right, uplift = (float(unit.get(name)) for name in ("lv_volume", "rv_volume", "apex_uplift"))
        found = f"{left:.2f} | {right:.2f} | {uplift:.2f}"
        rows.append(f"| P{order} | {levels} | {fine.mesh.elements} | {found} | {took / first:.0f} |")
    return "\n".join(rows)


if __name__ == "__main__":
    write_between(PAGE, "element_order", measure())
