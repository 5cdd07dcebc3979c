"""If these fail, FMI 3.0 tools refuse the FMUs, or read other variables, units or dependencies than are declared."""

import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest
from cardiac_cosim.fmus.fmi3.build import build_fmu
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality
from fmpy.validation import validate_fmu
from lxml import etree


@pytest.fixture(params=list(UNITS))
def unit(request: pytest.FixtureRequest) -> str:
    return request.param


def _root(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def test_fmpy_has_nothing_to_say(unit: str, fmus3: dict) -> None:
    assert validate_fmu(str(fmus3[unit])) == []


def test_the_schema_of_fmi_3(unit: str, fmus3: dict) -> None:
    schemas = Path(fmpy.__file__).parent / "schema" / "fmi3"
    schema = etree.XMLSchema(etree.parse(schemas / "fmi3ModelDescription.xsd"))
    assert schema.validate(_root(fmus3[unit])), schema.error_log


def test_the_variables_are_those_of_the_declaration(unit: str, tiny: Mesh, fmus3: dict) -> None:
    types: dict[type, Any] = {float: "Float64", int: "Int32", str: "String"}
    description = fmpy.read_model_description(str(fmus3[unit]), validate=False)
    time, *variables = description.modelVariables
    assert (time.name, time.causality, time.unit) == ("time", "independent", "s")
    declared = UNITS[unit].variables()
    assert [item.name for item in variables] == [item.name for item in declared]
    assert len({item.valueReference for item in description.modelVariables}) == len(declared) + 1
    for found, meant in zip(variables, declared, strict=True):
        assert found.causality == meant.causality.value
        assert found.type == types[type(meant.start)]
        assert found.shape == meant.shape(tiny)
        assert found.description == meant.description
        assert found.unit == (meant.unit if found.type == "Float64" else None)
        computed = meant.causality in (Causality.OUTPUT, Causality.CALCULATED_PARAMETER)
        assert (found.start is None) == computed
        # What is read is the declared value to the last bit.
        assert found.start is None or type(meant.start)(found.start) == meant.start
        assert found.min is None or float(found.min) == meant.at_least


def test_dependencies_are_those_of_the_declaration(unit: str, fmus3: dict) -> None:
    description = fmpy.read_model_description(str(fmus3[unit]), validate=False)
    inputs = {variable.name for variable in UNITS[unit].inputs()}
    found = {output.variable.name: output.dependencies for output in description.outputs}
    assert set(found) == {variable.name for variable in UNITS[unit].outputs()}
    for variable in UNITS[unit].outputs():
        dependencies = found[variable.name]
        named = inputs if dependencies is None else {item.name for item in dependencies}
        assert named == set(variable.depends_on), variable.name
        # No list would be a dependence on everything, fibres on the time too.
        assert inputs or dependencies == []


def test_units_of_measure_and_annotations_are_those_of_the_fmi_2_description(
    unit: str, fmus: dict, fmus3: dict
) -> None:
    two, three = _root(fmus[unit]), _root(fmus3[unit])

    def texts(root: etree._Element, path: str) -> list[str]:
        found = [etree.tostring(element).strip().decode() for element in root.findall(path)]
        assert found
        return found

    old = texts(two, "VendorAnnotations/Tool[@name='cardiac-cosim']/Unit")
    assert texts(three, "Annotations/Annotation[@type='cardiac-cosim']/Unit") == old
    seconds = '<Unit name="s"><BaseUnit s="1"/></Unit>'
    measures = texts(three, "UnitDefinitions/Unit")
    assert [text for text in measures if text != seconds] == texts(two, "UnitDefinitions/Unit")
    assert seconds in measures


def test_the_description_does_not_grow_with_the_mesh(unit: str, fmus3: dict, tmp_path: Path) -> None:
    heart = build_fmu(UNITS[unit], registry.build("biventricle", 5.0), tmp_path / "heart.fmu")
    sizes = []
    for path in (fmus3[unit], heart):
        with zipfile.ZipFile(path) as archive:
            sizes.append(archive.getinfo("modelDescription.xml").file_size)
    # More digits in the dimensions, no more.
    assert sizes[1] - sizes[0] < 100
    # A fifth of it are the compiled kernels.
    assert heart.stat().st_size < 600_000


def test_the_same_content_makes_the_same_bytes(unit: str, tiny: Mesh, fmus3: dict, tmp_path: Path) -> None:
    again = build_fmu(UNITS[unit], tiny, tmp_path / "again.fmu")
    assert again.read_bytes() == fmus3[unit].read_bytes()
