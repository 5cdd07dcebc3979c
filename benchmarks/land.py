"""The two passive problems of Land et al. 2015 with P1 and P2: writes the tables in docs/mechanics.md (minutes)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from cardiac_cosim.units.mesh import Mesh

from .land_problems import BULK_MPA, apex_mm, beam, ellipsoid, tip_mm
from .page import write_between

PAGE = Path(__file__).parent.parent / "docs" / "mechanics.md"
_PENALTIES_MPA = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
#: Cells across, for each polynomial order of the displacement.
_BEAMS, _ELLIPSOIDS = {2: (1, 2, 3, 4), 1: (2, 4, 8)}, {2: (1, 2, 3), 1: (2, 4, 6)}

Solve = Callable[[Mesh, int], float]


def _table(title: str, make: Callable[[int], Mesh], solve: Solve, cells: dict[int, tuple[int, ...]]) -> list[str]:
    """A row for each mesh: its size, the position, the difference from the finest P2, the observed order of accuracy.

    The order is left out where the position has passed that of the finest P2, or where the difference is not larger
    than the uncertainty of the finest P2 itself.
    """
    results = "position, mm | difference from the finest P2, mm | order of accuracy"
    rows = [f"| {title} | cells across | tetrahedra | {results} |", "|---|---|---|---|---|---|"]
    finest = known = 0.0
    for order, counts in cells.items():
        meshes = [make(count) for count in counts]
        found = [solve(mesh, order) for mesh in meshes]
        if not finest:
            finest, known = found[-1], 3.0 * abs(found[-1] - found[-2])
        before = None
        for count, mesh, height in zip(counts, meshes, found, strict=True):
            off = height - finest
            comes = before is not None and off / before[1] > 0.0 and abs(off) > known
            observed = f"{np.log(before[1] / off) / np.log(count / before[0]):.1f}" if comes else ""
            rows.append(f"| P{order} | {count} | {mesh.elements} | {height:.3f} | {off:+.3f} | {observed} |")
            before = (count, off)
    return rows


def measure() -> str:
    """The tables."""
    beams, ellipsoids = beam(2), ellipsoid(1)
    penalties = [
        "| κ in MPa | " + " | ".join(f"{bulk:g}" for bulk in _PENALTIES_MPA) + " |",
        "|---" * (len(_PENALTIES_MPA) + 1) + "|",
        "| tip of the beam, mm (P2, 2 cells across) | "
        + " | ".join(f"{tip_mm(beams, 2, bulk):.3f}" for bulk in _PENALTIES_MPA)
        + " |",
        "| apex of the ellipsoid, mm (P2, 1 cell across) | "
        + " | ".join(f"{apex_mm(ellipsoids, 2, bulk):.3f}" for bulk in _PENALTIES_MPA)
        + " |",
    ]
    return "\n".join(
        [
            *_table(f"tip of the beam, κ = {BULK_MPA:g} MPa", beam, tip_mm, _BEAMS),
            "",
            *_table(f"apex of the ellipsoid, κ = {BULK_MPA:g} MPa", ellipsoid, apex_mm, _ELLIPSOIDS),
            "",
            *penalties,
        ]
    )


if __name__ == "__main__":
    write_between(PAGE, "land", measure())
