"""If these fail, a foreign FMU's message is garbled, or its percent signs end the process."""

import shutil
import subprocess
from ctypes import CDLL, CFUNCTYPE, c_char_p, c_int, c_void_p, create_string_buffer
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.participants.printf import argument_types, can_read_arguments, filled

pytestmark = pytest.mark.skipif(
    not can_read_arguments() or shutil.which("cc") is None, reason="no known call convention, or no C compiler"
)

#: Formats with the arguments that a C program gives them.
_CALLS = {
    "plain": '"no conversion"',
    "numbers": '"%d %i %u %x %5d|%-5d|%05d|%+d", -1, 2, 3u, 255, 42, 42, 42, 42',
    "reals": '"%g %.3f %e %10.2f|%-10.2f|", 0.1, 3.14159, 1e300, -2.5, -2.5',
    "texts": '"%s, %10s|%-10s|%.3s, %c %%", "one", "two", "three", "four", \'x\'',
    "mixed": '"%d %g %s %ld %g %s %hhd %zu", 1, 2.5, "three", 4000000000L, 5.5, "six", 300, (size_t)8',
    "stars": '"%*d %-*d| %.*f", 6, 42, 6, 42, 2, 3.14159',
    "many reals": '"%g %g %g %g %g %g %g %g %g %g %d", 1., 2., 3., 4., 5., 6., 7., 8., 9., 10., 11',
    "umlauts": '"%s", "h\\u00f6her"',
}

_SOURCE = """
#include <stdio.h>
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
void call(Logger logger, int which, char *expected) {
    switch (which) {
%s
    case 100: logger(0, "n", 0, "c", "100%% of it, %%s %%n %%999999999d %%"); break;
    case 101: logger(0, "n", 0, "c", "%%s %%s", (char *)16, (char *)-1L); break;
    }
}
"""


@pytest.fixture(scope="module")
def call(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Let C log the message of a number; what was heard, and what C's own printf makes of it."""
    folder = tmp_path_factory.mktemp("printf")
    cases = "\n".join(
        f'    case {number}: snprintf(expected, 500, {text}); logger(0, "n", 0, "c", {text}); break;'
        for number, text in enumerate(_CALLS.values())
    )
    (folder / "call.c").write_text(_SOURCE % cases)
    command = ["cc", "-w", "-shared", "-fPIC", str(folder / "call.c"), "-o", str(folder / "call.so")]
    subprocess.run(command, check=True)
    library = CDLL(str(Path(folder) / "call.so"))
    kind: Any = CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, *argument_types())

    def heard(which: int) -> tuple[str, str]:
        found: list[bytes] = []
        expected = create_string_buffer(500)
        callback = kind(lambda *given: found.append(filled(given[4], given[5:])))
        library.call(callback, which, expected)
        return found[0].decode(errors="replace"), expected.value.decode()

    return heard


@pytest.mark.parametrize("name", _CALLS)
def test_messages_are_filled_in_as_c_does_it(name: str, call: Any) -> None:
    heard, expected = call(list(_CALLS).index(name))
    assert heard == expected


def test_arguments_that_are_not_there_are_not_looked_for(call: Any) -> None:
    assert call(100)[0].startswith("100")
    assert len(call(100)[0]) < 70000
    assert call(101)[0] == "(?) (?)"
