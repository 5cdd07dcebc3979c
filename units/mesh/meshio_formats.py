"""All other formats of meshes, read by meshio in a process of its own.

meshio prints to the standard output of the whole process, and its readers trust the files they read: of mutated ones,
some make them hang, or take all memory, or crash in a library beneath. In a child process with limits none of that
reaches us, and many threads may read at once.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from .stored import StoredMesh, UnreadableMesh, by_number

_CHILD = Path(__file__).with_name("meshio_child.py")

_REMEDY = "write it again, preferably in gmsh's format .msh"

#: Seconds of a processor that any file gets, and more for each megabyte; so long in all at most, on a busy machine.
_SECONDS, _SECONDS_PER_MB, _PATIENCE = 4.0, 2.0, 5.0
_LONGEST_SECONDS = 900.0
#: Bytes of memory that any file gets, and more for each byte in it.
_MEMORY, _MEMORY_PER_BYTE = 2 * 2**30, 50


def read_by_meshio(path: Path) -> StoredMesh:
    """The mesh in the file `path`; UnreadableMesh says why there is none."""
    try:
        size = path.stat().st_size
        with TemporaryDirectory(prefix="cosim-") as folder:
            _run_child(path.resolve(), Path(folder), size)
            found = json.loads((Path(folder) / "found.json").read_text(encoding="utf-8"))
            if "error" in found:
                raise UnreadableMesh(f"meshio cannot read it as a mesh ({found['error']}); {_REMEDY}")
            with np.load(Path(folder) / "found.npz", allow_pickle=False) as arrays:
                return StoredMesh(
                    arrays["points"],
                    arrays["tetra"],
                    arrays["triangle"],
                    found["others"],
                    {name: arrays[f"named {number}"] for number, name in enumerate(found["named"])},
                    {name: by_number(arrays[f"label {number}"]) for number, name in enumerate(found["labels"])},
                )
    except OSError as error:
        raise UnreadableMesh(f"cannot be read ({error.strerror or error})") from None


def _run_child(path: Path, folder: Path, size: int) -> None:
    seconds = min(_SECONDS + _SECONDS_PER_MB * size / 1e6, _LONGEST_SECONDS)
    memory = _MEMORY + _MEMORY_PER_BYTE * size
    command = [sys.executable, "-P", str(_CHILD), str(path), str(folder), str(round(seconds)), str(memory)]
    try:
        ended = subprocess.run(
            command,
            cwd=folder,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=_PATIENCE * seconds,
            check=False,
        )
        code = ended.returncode
    except subprocess.TimeoutExpired:
        code = None
    if code or not (folder / "found.json").is_file():
        reason = (
            f"it was stopped after {seconds:.0f} s"
            if code is None or code == -24
            else f"it was ended by signal {-code}"
            if code < 0
            else f"it ended with exit code {code}"
        )
        raise UnreadableMesh(f"meshio cannot read it as a mesh ({reason}); {_REMEDY}")
