"""If these fail, a host that makes and gives up many instances runs out of memory."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.fmus import wrapper

Run = Callable[..., Any]

_HERE = Path(__file__).parent
#: Blocks of lives, and how many each has; the first block makes what all others use.
_BLOCKS, _LIVES = 5, 2_500


def _figures(text: str, name: str) -> list[float]:
    return [float(line.split()[1]) for line in text.splitlines() if line.startswith(name + " ")]


def test_nothing_is_left_after_10_000_lives(plain_host: Path, resources: Path, fmi: int) -> None:
    # Each with states, a rollback, bytes written and read, and calls that fail; every other leaves a state behind.
    words = ["mute", *[f"lives:{_LIVES}"] * _BLOCKS, "alive"]
    command = [str(plain_host), str(wrapper.library()), str(fmi), str(resources), "silent", *words]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, check=True, env={"COSIM_PYTHON": sys.executable}
    )
    # The slave that is asked, and no other.
    assert _figures(done.stderr, "alive") == [1.0]
    memory = _figures(done.stderr, "memory")
    assert memory[0] > 0
    # Now and then the allocator takes some pages more. A pointer lost in every life would be 20 kB in every block.
    growth = [later - earlier for earlier, later in pairwise(memory)]
    assert min(growth) < 8, f"{growth} kB in {_LIVES} lives each"


def test_the_sanitizers_find_nothing_in_many_lives(run: Run, fmi: int) -> None:
    done = run(fmi, "mute", "lives:300", "alive", token="silent")
    assert _figures(done.err, "alive") == [1.0]


@pytest.mark.long
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
def test_valgrind_finds_nothing_lost_by_the_wrapper(plain_host: Path, resources: Path, fmi: int) -> None:
    options = ["--leak-check=full", "--show-leak-kinds=definite,indirect", "--error-exitcode=0", "--num-callers=40"]
    command = ["valgrind", *options, str(plain_host), str(wrapper.library()), str(fmi), str(resources), "silent"]
    environment = {"COSIM_PYTHON": sys.executable, "PYTHONMALLOC": "malloc", "PATH": os.environ["PATH"]}
    words = ["mute", "lives:200", "alive"]
    done = subprocess.run([*command, *words], capture_output=True, text=True, timeout=900, check=True, env=environment)
    assert _figures(done.stderr, "alive") == [1.0]
    # What Python makes once, for a module that load.py imports, it gives back at its end, which does
    # not come here. What is lost in every other life is the wrapper's, and so is what it allocated itself.
    lost = re.findall(r"in ([\d,]+) blocks are (?:definitely|indirectly) lost.*\n(?:.* at .*\n)(.*)\n", done.stderr)
    assert [(count, frame) for count, frame in lost if int(count.replace(",", "")) >= 100 or "cosim_fmu" in frame] == []
    # Python's integers read a digit of zero that has none, and what follows from it is told as well.
    errors = re.findall(r"(?:Invalid|uninitialised).*\n(.* at .*)\n", done.stderr)
    assert [frame for frame in errors if "cosim_fmu" in frame] == []
