"""Verifying an FMU by the reference experiments in it: each is run again by this master, and compared."""

from pathlib import Path

from ..errors import InputError
from ..participants.fmu_description import read_description
from ..participants.fmu_file import FmuFile
from .check import Check
from .experiment import Defaults, read_experiments
from .manifest import read_manifest
from .outcome import Verification
from .reference_files import ReferenceFiles


def verify_fmu(path: Path) -> Verification:
    """Run every reference experiment in the FMU at `path` again and compare it with its results.

    Raises
    ------
    InputError
        If that is no FMU, has no reference experiments, or if these are damaged: manifest, files of experiments,
        parameter sets and stimuli are read before anything is run.
    """
    notes: list[str] = []
    try:
        files = ReferenceFiles(path)
        description = read_description(FmuFile(path))
        manifest = read_manifest(files)
        experiments = read_experiments(files, manifest, Defaults.of(description.defaultExperiment), notes.append)
        checks = [Check(path, item, files, description, notes.append) for item in experiments]
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return Verification(tuple(check.outcome() for check in checks), tuple(notes))
