"""What the wrapper looks for in the resources of an FMU; the slave is loaded once in a process."""

import importlib.util
import sys
from pathlib import Path

NAME = "cosim_slave_of_the_wrappers_tests"


def instantiate(resources, token, fmi):
    if token not in ("right", "silent"):
        raise ValueError(f"the token {token} is not that of this FMU")
    if NAME not in sys.modules:
        spec = importlib.util.spec_from_file_location(NAME, Path(resources, "slave.py"))
        sys.modules[NAME] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[NAME])
    return sys.modules[NAME].Slave(resources, token, fmi)
