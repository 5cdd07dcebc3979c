"""Arrays as text of a page: all in one block of bytes, compressed, and a reference to each."""

import base64
import gzip
from typing import Any

import numpy as np

from ...orchestrator.participants.participant import Values

#: Bytes at whose multiples a browser's arrays may begin.
_ALIGNED = 4

#: The fastest: a page is made while somebody waits, and the slower ones save some percent.
_EFFORT = 1

#: Steps between the ends of a range of colours.
LEVELS = 65535


class Packed:
    """Gathers arrays; `reference` is what the page's program needs to find one."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0

    def add(self, array: Any, kind: str) -> dict[str, Any]:
        """Add an array as `kind`: "f4", "u4", or "index" for the shortest unsigned integers that hold it."""
        values = np.asarray(array)
        if kind == "index":
            kind = "u2" if values.max(initial=0) < 1 << 16 else "u4"
        content = np.ascontiguousarray(values, f"<{kind}").tobytes()
        reference = {"at": self._size, "kind": kind, "shape": list(values.shape)}
        padding = -len(content) % _ALIGNED
        self._parts.append(content + bytes(padding))
        self._size += len(content) + padding
        return reference

    def text(self) -> str:
        """All of it, compressed by gzip, in Base64."""
        return compressed(b"".join(self._parts))


def compressed(content: bytes) -> str:
    """`content` by gzip in Base64, the same bytes for the same content."""
    return base64.b64encode(gzip.compress(content, _EFFORT, mtime=0)).decode("ascii")


def levels(values: Values, low: float, high: float) -> Values:
    """Numbers as steps between `low` and `high`, 0 to LEVELS, for colours need no more."""
    return np.rint(np.clip((values - low) / (high - low), 0.0, 1.0) * LEVELS)
