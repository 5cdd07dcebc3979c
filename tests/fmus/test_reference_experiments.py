"""If these fail, our FMUs do not tell whether they work where they are, or they tell it of another unit than ours."""

import csv
import io
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.fmus.cache import cached_fmu
from cardiac_cosim.fmus.reference_experiment import TOLERANCE, reference_experiment
from cardiac_cosim.fmus.reference_members import FOLDER, reference_members
from cardiac_cosim.orchestrator.verification import Verdict, verify_fmu
from cardiac_cosim.units import kernels
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality

Fmu = Callable[..., Path]


def _started(name: str, mesh: Mesh) -> dict[str, bytes]:
    """The members of the FMI 2.0 FMU of a unit, if the unit starts with what its inputs start with."""
    members = reference_members(UNITS[name], mesh, 2)
    if not members:
        pytest.skip(f"the unit {name} has no initial state before it is given directions")
    return members


@pytest.fixture(scope="session")
def fmu(tiny: Mesh, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    """The FMU of a unit on the tiny mesh in FMI 2 or 3, with some of its reference members replaced."""
    folder = tmp_path_factory.mktemp("reference")

    def make(name: str, fmi: int, changes: dict[str, bytes] | None = None) -> Path:
        members = reference_members(UNITS[name], tiny, fmi) | (changes or {})
        destination = folder / f"{name}.fmu"
        source = cached_fmu(UNITS[name], tiny, folder / "cache", fmi)
        with zipfile.ZipFile(source) as archive, zipfile.ZipFile(destination, "w") as copy:
            for item in archive.namelist():
                if item not in members:
                    copy.writestr(item, archive.read(item))
            for item, content in members.items():
                copy.writestr(item, content)
        return destination

    return make


def _rows(table: bytes) -> list[list[str]]:
    return list(csv.reader(io.StringIO(table.decode())))


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", list(UNITS))
def test_the_fmu_of_every_unit_verifies_itself(fmu: Fmu, tiny: Mesh, name: str, fmi: int) -> None:
    _started(name, tiny)
    verification = verify_fmu(fmu(name, fmi))
    assert verification.is_verified, verification.reasons
    assert verification.notes == ()
    assert all(item.verdict is Verdict.WITHIN for item in verification.outcomes[0].comparisons)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", ["active_stress", "mass", "fiber_generator", "mechanics"])
def test_a_result_in_its_seventh_digit_is_told(fmu: Fmu, tiny: Mesh, name: str, fmi: int) -> None:
    rows = _rows(_started(name, tiny)[f"{FOLDER}/results.csv"])
    values = np.array(rows[1:], dtype=float)
    row, column = 1 + int(np.abs(values[:, 1]).argmax()), 1
    rows[row][column] = repr(float(rows[row][column]) * (1 + 2 * TOLERANCE))
    changed = "\n".join(",".join(f'"{cell}"' for cell in cells) for cells in rows).encode()
    verification = verify_fmu(fmu(name, fmi, {f"{FOLDER}/results.csv": changed}))
    deviating = [item.variable for item in verification.outcomes[0].comparisons if item.verdict is Verdict.DEVIATES]
    assert deviating == [rows[0][column]]


@pytest.mark.parametrize("name", list(UNITS))
def test_the_experiment_makes_the_unit_do_something(tiny: Mesh, name: str) -> None:
    _started(name, tiny)
    experiment = reference_experiment(UNITS[name], tiny)
    assert experiment is not None
    assert all(np.isfinite(values).all() for values in experiment.answers.values())
    assert any(values.any() for values in experiment.answers.values())
    # What is driven is all that matters by itself, and stays within the declared shape.
    driven = {item.name for item in UNITS[name].inputs() if not item.fixed and item.needs is None}
    assert set(experiment.inputs) == driven
    for item in UNITS[name].inputs():
        if item.name in driven:
            assert experiment.inputs[item.name].shape == item.shape(tiny)
            assert (experiment.inputs[item.name] != item.start).any()


@pytest.mark.parametrize("name", ["electrophysiology", "active_stress", "mechanics"])
def test_other_kernels_are_well_within_the_tolerance(tiny: Mesh, name: str) -> None:
    # Otherwise it would be the processor that is verified.
    _started(name, tiny)
    own = reference_experiment(UNITS[name], tiny)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(kernels.CHOICE, kernels.WITHOUT)
        other = reference_experiment(UNITS[name], tiny)
    assert own is not None
    assert other is not None
    for answer, values in own.answers.items():
        scale = np.abs(values).max() or 1.0
        assert np.abs(values - other.answers[answer]).max() <= 0.01 * TOLERANCE * scale


def test_the_same_unit_has_the_same_bytes(tiny: Mesh) -> None:
    for name in ("active_stress", "mass", "response"):
        for fmi in (2, 3):
            assert reference_members(UNITS[name], tiny, fmi) == reference_members(UNITS[name], tiny, fmi)


def test_an_array_is_one_column_in_fmi_3_and_few_in_fmi_2(baseline: Mesh) -> None:
    two = _rows(reference_members(UNITS["active_stress"], baseline, 2)[f"{FOLDER}/inputs.csv"])
    three = _rows(reference_members(UNITS["active_stress"], baseline, 3)[f"{FOLDER}/inputs.csv"])
    assert two[0] == ["time", *(f"potential[{place}]" for place in range(1, 9))]
    assert three[0] == ["time", "potential"]
    values = np.array(three[1][1].split(), dtype=float)
    assert values.shape == (baseline.nodes,)
    assert values[:8].tolist() == list(map(float, two[1][1:]))
    start = UNITS["active_stress"].variable("potential").start
    assert set(values[8:].tolist()) == {start}
    # A packed FMU of the heart has half a megabyte.
    for fmi in (2, 3):
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for item, content in reference_members(UNITS["active_stress"], baseline, fmi).items():
                archive.writestr(item, content)
        assert len(packed.getvalue()) < 5000


def test_scalar_outputs_are_the_results_and_else_elements_of_fields(tiny: Mesh) -> None:
    for name, kind in UNITS.items():
        experiment = reference_experiment(kind, tiny)
        if experiment is None:
            continue
        scalars = [
            item.name for item in kind.variables() if item.causality is Causality.OUTPUT and not item.shape(tiny)
        ]
        assert list(experiment.answers)[: len(scalars)] == scalars, name
        assert scalars or list(experiment.answers)[:3] == ["fiber[1,1]", "fiber[1,2]", "fiber[1,3]"]
