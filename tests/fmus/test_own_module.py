"""If these failed, somebody's own unit would not come along in its FMU, which then runs nowhere, or runs other code."""

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cardiac_cosim.fmus.build import build_fmu, fingerprint
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.unit import Unit
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

_SOURCE = """\
import numpy as np
from cardiac_cosim.units.errors import StepFailure
from cardiac_cosim.units.unit import Unit
from cardiac_cosim.units.variable import (
    Causality,
    Variable,
)


class Scaled(Unit):
    \"\"\"A number times three, below ten.\"\"\"

    name = "scaled"
    groups = ()
    fields = (
        Variable("u", Causality.INPUT, "MEASURE", "a number"),
        Variable("y", Causality.OUTPUT, "MEASURE", "three times it", depends_on=("u",)),
    )

    def prepare(self):
        pass

    def initial(self, inputs):
        return {"y": np.asarray(3.0 * inputs["u"])}

    def advance(self, state, begin, inputs, time, step):
        if inputs["u"] > 10.0:
            raise StepFailure("u is above ten")
        return self.initial(inputs)

    def output(self, name, state):
        return state[name]
"""


@pytest.fixture(scope="module")
def cell() -> Mesh:
    return build("cell", 1.0)


def _unit(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str = _SOURCE.replace("MEASURE", "1")) -> type[Unit]:
    """The unit in `text`, from a file that no other process could import."""
    folder.mkdir(exist_ok=True)
    path = folder / "scaled_unit.py"
    path.write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location("scaled_unit", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "scaled_unit", module)
    spec.loader.exec_module(module)
    unit: type[Unit] = module.Scaled
    return unit


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_fmu_runs_where_the_module_is_not(
    fmi: int, cell: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = build_fmu(_unit(tmp_path / "own", monkeypatch), cell, tmp_path / "scaled.fmu", fmi)
    program = f"""
from fmpy import simulate_fmu
print(simulate_fmu({str(path)!r}, start_values={{"u": 2.0}}, stop_time=0.002, output_interval=0.001)["y"].tolist())
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "[6.0, 6.0, 6.0]", done.stderr


def test_a_step_that_the_unit_cannot_do_is_discarded_as_such(
    cell: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Its StepFailure is the FMU's own class, or it would be taken for a mistake of the caller's.
    path = build_fmu(_unit(tmp_path / "own", monkeypatch), cell, tmp_path / "scaled.fmu")
    folder = extract(str(path), str(tmp_path / "unpacked"))
    description = read_model_description(folder)
    slave = FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier="scaled", instanceName="scaled")
    slave.instantiate()
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    (reference,) = (item.valueReference for item in description.modelVariables if item.name == "u")
    slave.setReal([reference], [11.0])
    with pytest.raises(FMICallException, match="status 2"):
        slave.doStep(0.0, 0.001)
    slave.freeInstance()


def test_other_code_makes_another_fmu(cell: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = _SOURCE.replace("MEASURE", "1")
    one = _unit(tmp_path / "one", monkeypatch, text)
    first = fingerprint(one, cell)
    path = build_fmu(one, cell, tmp_path / "one.fmu")
    other = _unit(tmp_path / "other", monkeypatch, text.replace("3.0 *", "4.0 *"))
    assert fingerprint(other, cell) != first
    # Both in one process, and neither runs the other's code.
    for fmu, factor in ((path, 3.0), (build_fmu(other, cell, tmp_path / "other.fmu"), 4.0)):
        rows = simulate_fmu(str(fmu), start_values={"u": 2.0}, stop_time=0.001, output_interval=0.001)
        assert np.array_equal(rows["y"], [2.0 * factor, 2.0 * factor])
    assert "scaled" not in UNITS


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "import numpy as np",
            "import numpy as np\nimport cardiac_cosim.units.unit",
            "line 2.*cannot carry this import",
        ),
        (
            "import numpy as np",
            "import numpy as np\nfrom cardiac_cosim.fmus.build import build_fmu",
            "line 2.*cannot carry",
        ),
        ("MEASURE", "furlong", "'u' of unit 'scaled' is measured in 'furlong', which is none of 1, deg, mm"),
    ],
    ids=["whole package", "another floor", "unit of measure"],
)
def test_what_an_fmu_cannot_have_is_refused(
    old: str, new: str, told: str, cell: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = _unit(tmp_path / "own", monkeypatch, _SOURCE.replace(old, new).replace("MEASURE", "1"))
    with pytest.raises(InvalidInput, match=told):
        build_fmu(unit, cell, tmp_path / "scaled.fmu")
    assert not (tmp_path / "scaled.fmu").exists()


def test_a_class_inside_of_a_function_is_refused(cell: Mesh, tmp_path: Path) -> None:
    class Inside(UNITS["response"]):  # type: ignore[misc]
        """One that a module does not have at its top."""

        name = "inside"

    with pytest.raises(InvalidInput, match=r"unit 'inside' cannot be carried by an FMU.*a file of its own"):
        build_fmu(Inside, cell, tmp_path / "inside.fmu")
