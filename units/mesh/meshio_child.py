"""A program of its own: read one mesh file by meshio and leave what it holds as plain arrays.

    python meshio_child.py FILE FOLDER SECONDS BYTES

writes FOLDER/found.json and FOLDER/found.npz. It uses at most SECONDS of a processor and BYTES of memory: meshio's
readers believe what a file says of itself, and some of them never end. Run by `meshio_formats`.
"""

import json
import resource
import sys
from pathlib import Path
from typing import Any

#: What an XML file declares entities with, which a parser would expand to whatever length; no mesh needs one.
_DECLARATIONS = (b"<!DOCTYPE", b"<!ENTITY")

_PHYSICAL = "gmsh:physical"


def main(path: Path, folder: Path, seconds: int, size: int) -> None:
    """Read `path` within the limits."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 1))
    resource.setrlimit(resource.RLIMIT_AS, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        found, arrays = _found(path)
    # meshio answers a file it cannot read with ReadError, SystemExit or whatever its parsers trip over.
    except (Exception, SystemExit) as error:
        text = "no reader accepts the file" if isinstance(error, SystemExit) else " ".join(str(error).split())[:200]
        found, arrays = {"error": text or type(error).__name__}, {}
    import numpy as np

    np.savez(folder / "found.npz", allow_pickle=False, **arrays)
    (folder / "found.json").write_text(json.dumps(found), encoding="utf-8")


def _found(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    import numpy as np

    _check_xml(path)
    import meshio

    stored = meshio.read(path)
    cells = stored.cells_dict
    empty = np.empty((0, 3), dtype=np.int64)
    triangles = np.asarray(cells.get("triangle", empty), dtype=np.int64)
    arrays = {
        "points": np.asarray(stored.points, dtype=np.float64),
        "tetra": np.asarray(cells.get("tetra", np.empty((0, 4))), dtype=np.int64),
        "triangle": triangles,
    }
    others: dict[str, int] = {}
    for block in stored.cells:
        if block.dim >= 2 and block.type not in ("triangle", "tetra") and len(block.data):
            others[block.type] = others.get(block.type, 0) + len(block.data)
    labels = {}
    for name, by_kind in stored.cell_data_dict.items():
        values = _whole(by_kind.get("triangle"))
        if values is not None and len(values) == len(triangles):
            labels[str(name)] = values
    named = {}
    for name, members in stored.cell_sets_dict.items():
        if "triangle" in members and not name.startswith("gmsh:"):
            named[str(name)] = np.asarray(members["triangle"], dtype=np.int64)
    for name, members in _by_labels(stored, labels).items():
        named.setdefault(name, members)
    arrays |= {f"label {number}": values for number, values in enumerate(labels.values())}
    arrays |= {f"named {number}": members for number, members in enumerate(named.values())}
    return {"others": others, "labels": list(labels), "named": list(named)}, arrays


def _by_labels(stored: Any, labels: dict[str, Any]) -> dict[str, Any]:
    """Names that a file gives to its numbers: physical groups as gmsh has them, groups of MED's families."""
    import numpy as np

    named = {}
    if _PHYSICAL in labels:
        for name, tag in stored.field_data.items():
            if np.size(tag) == 2 and int(np.ravel(tag)[1]) == 2:
                named[str(name)] = np.flatnonzero(labels[_PHYSICAL] == int(np.ravel(tag)[0]))
    families = getattr(stored, "cell_tags", None) or {}
    for name in dict.fromkeys(name for names in families.values() for name in names):
        own = [number for number, names in families.items() if name in names]
        named[str(name)] = np.flatnonzero(np.isin(labels.get("cell_tags", np.empty(0)), own))
    return {name: members for name, members in named.items() if len(members)}


def _whole(values: Any) -> Any:
    """`values` as whole numbers, shape (faces,); None if they are something else."""
    import numpy as np

    if values is None:
        return None
    values = np.asarray(values)
    if values.ndim == 2 and values.shape[1] == 1:
        values = values[:, 0]
    if values.ndim != 1 or values.dtype.kind not in "iuf":
        return None
    whole = (np.abs(values.astype(np.float64)) < 2.0**53) & (values == np.rint(values))
    return values.astype(np.int64) if whole.all() else None


def _check_xml(path: Path) -> None:
    content = path.read_bytes()
    # In UTF-16 every other byte is zero.
    if content[:64].replace(b"\0", b"").lstrip(b"\xef\xbb\xbf\xff\xfe \t\r\n")[:1] != b"<":
        return
    plain = content.replace(b"\0", b"")
    if any(sign in plain for sign in _DECLARATIONS):
        raise ValueError("it declares entities or a document type, which no mesh needs; remove <!DOCTYPE ...>")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
