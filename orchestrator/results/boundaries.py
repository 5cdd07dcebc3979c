"""The named boundaries of a mesh in fields.h5: a group with a data set for each, the nodes of its faces.

Groups of a mesh file may have any name, while HDF5 takes a slash for a path: what has a meaning there is written as in
web addresses (`%2F`). A mesh without boundaries has no such group.
"""

from collections.abc import Mapping
from urllib.parse import unquote

import h5py
import numpy as np
from numpy.typing import NDArray

#: The name of the group.
GROUP = "boundaries"

_ESCAPES = str.maketrans({"%": "%25", "/": "%2F", "\0": "%00"})


def write_boundaries(file: h5py.File, boundaries: Mapping[str, NDArray[np.int64]]) -> None:
    """Add the group with the faces of each boundary, shape (faces, dimension)."""
    for name, faces in boundaries.items():
        file[f"{GROUP}/{_link(name)}"] = faces


def read_boundaries(file: h5py.File) -> dict[str, NDArray[np.int64]]:
    """What `write_boundaries` has written; empty for a file without the group."""
    if GROUP not in file:
        return {}
    return {unquote(link): faces[:].astype(np.int64) for link, faces in file[GROUP].items()}


def _link(name: str) -> str:
    """The name of a data set for a boundary called so; of points alone would be the group itself."""
    return "%2E" * len(name) if not name.strip(".") else name.translate(_ESCAPES)
