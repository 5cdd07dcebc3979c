"""Sessions of gmsh: one model at a time, quiet, deterministic, and nothing left behind."""

import ctypes
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np

from ..arrays import FloatArray, IntArray
from ..errors import InvalidInput

#: What gmsh's shared library needs on a Debian or Ubuntu system without a desktop; the rest follows from these.
DEBIAN_PACKAGES = ("libgl1", "libglu1-mesa", "libgomp1", "libxcursor1", "libxft2", "libxinerama1")

# Every option that changes the mesh is set, also those whose default is right: a caller may have changed it.
_OPTIONS = {
    "General.Terminal": 0,
    "General.NumThreads": 1,
    "Geometry.Tolerance": 1e-8,
    "Geometry.ToleranceBoolean": 0,
    "Geometry.OCCAutoFix": 1,
    "Geometry.OCCParallel": 0,
    "Geometry.OCCScaling": 1,
    "Geometry.OCCUnionUnify": 1,
    "Mesh.Algorithm": 6,  # Frontal-Delaunay: the most regular triangles
    "Mesh.Algorithm3D": 1,  # Delaunay
    "Mesh.ElementOrder": 1,
    "Mesh.MaxNumThreads1D": 1,
    "Mesh.MaxNumThreads2D": 1,
    "Mesh.MaxNumThreads3D": 1,
    "Mesh.MeshSizeExtendFromBoundary": 1,
    "Mesh.MeshSizeFactor": 1,
    "Mesh.MeshSizeFromCurvature": 0,
    "Mesh.MeshSizeFromPoints": 1,
    "Mesh.Optimize": 1,
    "Mesh.OptimizeNetgen": 1,
    "Mesh.OptimizeThreshold": 0.3,
    "Mesh.RandomFactor": 1e-9,
    "Mesh.RandomFactor3D": 1e-12,
    "Mesh.RandomSeed": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.Smoothing": 1,
    "Mesh.SubdivisionAlgorithm": 0,
}

_SIZES = ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax")

_MODEL = "cardiac_cosim geometry"

# gmsh keeps one current model per process.
_lock = threading.Lock()


@contextmanager
def gmsh_model(size_mm: float) -> Iterator[ModuleType]:
    """The gmsh module with an empty current model for elements of `size_mm`, whether or not the caller uses gmsh too.

    Raises
    ------
    InvalidInput
        If gmsh is not installed or its shared library lacks others.
    """
    gmsh = _import_gmsh()
    with _lock:
        if gmsh.isInitialized():
            with _as_guest(gmsh):
                _set_up(gmsh, size_mm)
                yield gmsh
            return
        # Not interruptible: signal handlers can only be set in the main thread. No configuration files: the mesh must
        # not depend on the user's.
        with _broken_pipes_as_before():
            gmsh.initialize(readConfigFiles=False, interruptible=False)
        try:
            _set_up(gmsh, size_mm)
            yield gmsh
        finally:
            gmsh.finalize()


@contextmanager
def _broken_pipes_as_before() -> Iterator[None]:
    """Give SIGPIPE back its meaning: gmsh has it end the process, where Python makes an error of a broken pipe.

    By the C library, for Python sets signals in its main thread only, and meshes are made in others too.
    """
    if not hasattr(signal, "SIGPIPE"):
        yield
        return
    set_signal = ctypes.CDLL(None).signal
    set_signal.argtypes, set_signal.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
    before = set_signal(signal.SIGPIPE, int(signal.SIG_IGN))
    try:
        yield
    finally:
        set_signal(signal.SIGPIPE, before)


def _set_up(gmsh: ModuleType, size_mm: float) -> None:
    for name, value in _OPTIONS.items():
        gmsh.option.setNumber(name, value)
    for name in _SIZES:
        gmsh.option.setNumber(name, size_mm)
    gmsh.model.add(_MODEL)


@contextmanager
def _as_guest(gmsh: ModuleType) -> Iterator[None]:
    """Leave the caller's gmsh session as it was: its options, models and which of them is current."""
    options = {name: gmsh.option.getNumber(name) for name in (*_OPTIONS, *_SIZES)}
    current = gmsh.model.getCurrent() if gmsh.model.list() else None
    try:
        yield
    finally:
        if _MODEL in gmsh.model.list():
            gmsh.model.setCurrent(_MODEL)
            gmsh.model.remove()
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        if current is not None:
            gmsh.model.setCurrent(current)


def tetrahedralise(gmsh: ModuleType) -> tuple[FloatArray, IntArray, list[IntArray]]:
    """Mesh the current model.

    Returns
    -------
    points, cells, faces:
        Coordinates (nodes, 3) in mm of the nodes that have an element, elements (elements, 4), and for each surface
        of the model its triangles (faces, 3).
    """
    try:
        gmsh.model.mesh.generate(3)
    # gmsh raises nothing more specific.
    except Exception as error:
        size_mm = gmsh.option.getNumber(_SIZES[0])
        raise InvalidInput(f"gmsh cannot mesh this anatomy at mesh_size_mm = {size_mm:g} ({error})") from error
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, _, (nodes_of_cells,) = gmsh.model.mesh.getElements(3)
    used = np.unique(nodes_of_cells)
    number = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    place = np.empty(len(number), dtype=np.int64)
    place[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)[place[used]]
    faces = [
        number[gmsh.model.mesh.getElements(2, surface)[2][0]].reshape(-1, 3) for _, surface in gmsh.model.getEntities(2)
    ]
    return points, number[nodes_of_cells].reshape(-1, 4), faces


def _import_gmsh() -> ModuleType:
    try:
        import gmsh
    except ImportError as error:
        raise InvalidInput(f"making a mesh needs the Python package gmsh: pip install gmsh ({error})") from error
    except OSError as error:
        raise InvalidInput(
            f"gmsh cannot be loaded ({error}): the system lacks libraries that it is linked with. "
            f"On Debian and Ubuntu: apt-get install {' '.join(DEBIAN_PACKAGES)}"
        ) from error
    module: ModuleType = gmsh
    return module
