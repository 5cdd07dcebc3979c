"""Compiled kernels: the inner loops of the units in C, with NumPy as the fallback and as the oracle of the tests.

One shared library holds every kernel in several variants, one for each instruction set it was compiled for; the best
that the processor has is taken. Two variants, and NumPy, round differently: results agree to about 1e-12, not to the
last bit. The environment variable `COSIM_KERNELS` takes another: the name of a variant (to get the bits of an older
processor), or `none` for NumPy.
"""

import ctypes
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidInput

#: The environment variable, and what it says for NumPy.
CHOICE, WITHOUT = "COSIM_KERNELS", "none"

#: The variants by name, in the order of `kernel_variants` in kernels.c, and what people call them.
_INSTRUCTIONS = {"baseline": "baseline instructions", "avx2": "AVX2", "avx512": "AVX-512"}

Kernel = Callable[..., Any]


def available() -> tuple[str, ...]:
    """The variants that this processor can run, the best one last; empty where nothing was compiled."""
    library = _library()
    return tuple(_INSTRUCTIONS)[: library.kernel_variants()] if library is not None else ()


def variant() -> str | None:
    """The variant in use; None for NumPy. InvalidInput where COSIM_KERNELS asks for one that is not available."""
    choice, names = os.environ.get(CHOICE, ""), available()
    if choice == WITHOUT:
        return None
    if choice and choice not in names:
        raise InvalidInput(
            f"the environment variable {CHOICE} is {choice!r}; on this machine it can be: "
            + ", ".join((*names, WITHOUT))
        )
    return choice or (names[-1] if names else None)


def kernel(name: str, *, integers: int = 0, pointers: int) -> Kernel:
    """The function `name` in the variant in use, of which there has to be one (`variant`).

    It takes a number of 64-bit integers, then a number of `pointers`, and returns a C int.
    """
    function: Any = getattr(_library(), f"{name}_{variant()}")
    function.argtypes = [ctypes.c_int64] * integers + [ctypes.c_void_p] * pointers
    return function


def law_number(name: str) -> int:
    """The number by which the kernels know the passive law `name`; -1 if they do not."""
    library = _library()
    return -1 if library is None else int(library.law_number(name.encode()))


def described() -> str:
    """What is in use, for a person."""
    used = variant()
    return "NumPy" if used is None else f"compiled kernels ({_INSTRUCTIONS[used]})"


def fallback() -> Iterator[str]:
    """A sentence for a person where NumPy has to stand in for kernels that were not compiled."""
    if not available() and os.environ.get(CHOICE) != WITHOUT:
        yield (
            "the compiled kernels are missing, so NumPy computes everything, several times slower; install a C "
            "compiler (gcc) and install the package again"
        )


@contextmanager
def using(choice: str) -> Iterator[None]:
    """Units that are initialised inside take this variant, or NumPy (`none`): to compare them."""
    before = os.environ.get(CHOICE)
    os.environ[CHOICE] = choice
    try:
        yield
    finally:
        if before is None:
            del os.environ[CHOICE]
        else:
            os.environ[CHOICE] = before


def address(array: np.ndarray) -> int:
    """Where a C-contiguous array lies in memory; the caller keeps it alive, and has checked its shape and type."""
    return array.__array_interface__["data"][0]


def _library() -> ctypes.CDLL | None:
    return _LOADED


def _load() -> ctypes.CDLL | None:
    path = next(iter(sorted(Path(__file__).parent.glob("compiled.*so"))), None)
    return None if path is None else ctypes.CDLL(str(path))


# At once, not when it is needed first: an FMU's code outlives the folder it was unpacked to, for other instances.
_LOADED = _load()
