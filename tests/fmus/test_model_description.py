"""If these fail, other tools refuse the FMUs, misread units of measure, or order the coupling by wrong dependencies."""

import math
import re
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from cardiac_cosim.fmus.model_description import model_description
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality
from fmpy.validation import validate_fmu
from lxml import etree

# What a user of SI knows of the units: kg, m, s, A, rad, and the factor to the base units.
_SI = {
    "1": ((0, 0, 0, 0, 0), 1.0),
    "deg": ((0, 0, 0, 0, 1), math.pi / 180),
    "mm": ((0, 1, 0, 0, 0), 1e-3),
    "ml": ((0, 3, 0, 0, 0), 1e-6),
    "ms": ((0, 0, 1, 0, 0), 1e-3),
    "1/ms": ((0, 0, -1, 0, 0), 1e3),
    "mm2/ms": ((0, 2, -1, 0, 0), 1e-6 / 1e-3),
    "mV": ((1, 2, -3, -1, 0), 1e-3),
    "1/mV": ((-1, -2, 3, 1, 0), 1 / 1e-3),
    "kPa": ((1, -1, -2, 0, 0), 1e3),
    "MPa": ((1, -1, -2, 0, 0), 1e6),
    "kPa/mm": ((1, -2, -2, 0, 0), 1e3 / 1e-3),
    # Pa/V: (kg m-1 s-2) / (kg m2 s-3 A-1)
    "MPa/mV": ((0, -3, 1, 1, 0), 1e6 / 1e-3),
}

# The unit of measure that the end of a parameter's name promises.
_SUFFIXES = {
    "_kPa_per_mm": ("kPa/mm",),
    "_per_mV": ("1/mV", "MPa/mV"),
    "_per_ms": ("1/ms", "mm2/ms"),
    "_mV": ("mV",),
    "_ms": ("ms",),
    "_mm": ("mm",),
    "_MPa": ("MPa",),
    "_deg": ("deg",),
}

_TIMES = {"ms"}

_CALCULATED = ["implementation", "fallbacks"]


def _root(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


@pytest.fixture(params=list(UNITS))
def unit(request: pytest.FixtureRequest) -> str:
    return request.param


def _outputs(unit: str, mesh: Mesh) -> Iterator[str]:
    for variable in UNITS[unit].outputs():
        shape = variable.shape(mesh)
        for index in np.ndindex(*shape):
            yield f"{variable.name}[{','.join(str(i + 1) for i in index)}]" if shape else variable.name


def test_fmpy_has_nothing_to_say(unit: str, fmus: dict) -> None:
    assert validate_fmu(str(fmus[unit])) == []


def test_fmpy_accepts_the_baseline_heart(unit: str, baseline: Mesh, baseline_fmus: dict) -> None:
    # Without the names, for which FMPy takes minutes; they are made by the same rule on the tiny mesh.
    description = fmpy.read_model_description(
        str(baseline_fmus[unit]), validate=True, validate_variable_names=False, validate_model_structure=True
    )
    count = sum(1 for _ in _outputs(unit, baseline))
    assert (len(description.outputs), len(description.initialUnknowns)) == (count, count + len(_CALCULATED))


def test_the_schema_of_fmi_2(unit: str, fmus: dict) -> None:
    schemas = Path(fmpy.__file__).parent / "schema" / "fmi2"
    schema = etree.XMLSchema(etree.parse(schemas / "fmi2ModelDescription.xsd"))
    assert schema.validate(_root(fmus[unit])), schema.error_log


def test_what_the_fmu_can_do(unit: str, fmus: dict) -> None:
    (element,) = _root(fmus[unit]).findall("CoSimulation")
    assert dict(element.attrib) == {
        "modelIdentifier": unit,
        "needsExecutionTool": "false",
        "canHandleVariableCommunicationStepSize": "true",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }
    assert {name for name in _names(fmus[unit]) if name.startswith("binaries/")} >= {f"binaries/linux64/{unit}.so"}


def _names(path: Path) -> list[str]:
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


def test_every_real_has_a_unit_that_is_defined_in_si(unit: str, fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    reals = [variable for variable in description.modelVariables if variable.type == "Real"]
    assert len(reals) > 3
    defined = {item.name: item.baseUnit for item in description.unitDefinitions}
    assert {variable.unit for variable in reals} == set(defined)
    for name, base in defined.items():
        exponents, factor = _SI[name]
        assert (base.kg, base.m, base.s, base.A, base.rad) == exponents, name
        assert (base.K, base.mol, base.cd, base.offset) == (0, 0, 0, 0), name
        assert base.factor == pytest.approx(factor, rel=1e-15), name


def test_names_of_parameters_end_in_their_unit(unit: str, fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    seen = 0
    for variable in description.modelVariables:
        if variable.type == "Real" and variable.causality == "parameter":
            promised = next((units for end, units in _SUFFIXES.items() if variable.name.endswith(end)), ("1",))
            seen += promised != ("1",)
            assert variable.unit in promised, variable.name
    # A mass on a spring is in numbers of any units of measure.
    assert seen > 0 or unit == "mass"


def test_times_have_a_unit(fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus["electrophysiology"]), validate=False)
    times = [
        v for v in description.modelVariables if re.match(r".*(_time|substep|time_scale(_start|_end)?)_ms$", v.name)
    ]
    activation = [v for v in description.modelVariables if v.name.startswith("activation_time[")]
    assert len(times) >= 4
    assert activation
    assert {v.unit for v in (*times, *activation)} == _TIMES


def test_parameters_say_what_they_are(unit: str, fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    declared = {item.name: item for item in UNITS[unit].variables() if item.causality is Causality.PARAMETER}
    given = {v.name: v for v in description.modelVariables if v.causality == "parameter"}
    assert list(given) == list(declared)
    for name, variable in given.items():
        assert variable.description == declared[name].description != ""
        assert (variable.variability, variable.initial) == ("fixed", "exact")
        # The very same value, to the last bit.
        assert {"Real": float, "Integer": int, "String": str}[variable.type](variable.start) == declared[name].start
        assert (variable.min is not None) == (declared[name].at_least is not None)
        if variable.min is not None:
            assert float(variable.min) == declared[name].at_least


def test_a_start_value_keeps_all_its_digits(tiny: Mesh) -> None:
    potential, *others = ActiveStress.fields

    class Other(ActiveStress):
        """Another."""

        fields = (replace(potential, start=-100.0 / 3.0), *others)

    root = etree.fromstring(model_description(Other, tiny, "{0}", "a test").encode())
    (start,) = root.xpath("//ScalarVariable[@name='potential[1]']/Real/@start")
    assert float(start) == -100.0 / 3.0


def test_inputs_have_start_values_and_fixed_ones_are_discrete(unit: str, fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    for variable in description.modelVariables:
        declared = UNITS[unit].variable(variable.name.split("[")[0])
        assert variable.causality == declared.causality.value
        if declared.causality is Causality.INPUT:
            assert float(variable.start) == declared.start
            assert variable.variability == ("discrete" if declared.fixed else "continuous")


def test_outputs_are_exactly_the_outputs_and_initial_unknowns_all_that_is_computed(
    unit: str, tiny: Mesh, fmus: dict
) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    expected = list(_outputs(unit, tiny))
    assert [unknown.variable.name for unknown in description.outputs] == expected
    assert [unknown.variable.name for unknown in description.initialUnknowns] == [*expected, *_CALCULATED]


def test_what_a_unit_computes_with_is_calculated_once(unit: str, fmus: dict) -> None:
    description = fmpy.read_model_description(str(fmus[unit]), validate=False)
    found = [item for item in description.modelVariables if item.name in _CALCULATED]
    kinds = {(item.type, item.causality, item.variability, item.initial, item.start) for item in found}
    assert (len(found), kinds) == (2, {("String", "calculatedParameter", "fixed", "calculated", None)})


def test_fibres_depend_on_nothing(fmus: dict) -> None:
    unknowns = _root(fmus["fiber_generator"]).findall("ModelStructure/Outputs/Unknown")
    assert {unknown.get("dependencies") for unknown in unknowns} == {""}


def test_active_stress_depends_on_its_own_place(tiny: Mesh, fmus: dict) -> None:
    root = _root(fmus["active_stress"])
    names = [element.get("name") for element in root.findall("ModelVariables/ScalarVariable")]
    unknowns = root.findall("ModelStructure/Outputs/Unknown")
    scalars = [unknown for unknown in unknowns if "[" not in names[int(unknown.get("index")) - 1]]
    # Its mean and maximum are of all places, and so follow all inputs: no attribute.
    follow_all = [names[int(unknown.get("index")) - 1] for unknown in scalars if "dependencies" not in unknown.attrib]
    assert follow_all == ["active_stress_mean", "active_stress_max"]
    seen = set()
    for unknown in (each for each in unknowns if each not in scalars):
        name, place = re.fullmatch(r"(\w+)\[(\d+)\]", names[int(unknown.get("index")) - 1]).groups()
        around = np.flatnonzero((tiny.cells == int(place) - 1).any(axis=1)) + 1
        stretches = [f"stretch[{element}]" for element in around]
        assert [names[int(index) - 1] for index in unknown.get("dependencies").split()] == {
            "active_stress": [f"potential[{place}]", *stretches],
            "active_stiffness": [f"potential[{place}]"],
            "reference_stretch": [f"stretch[{place}]"],
        }[name]
        seen.add(name)
    assert len(seen) == 3


@pytest.mark.parametrize("coupled", ["electrophysiology", "mechanics"])
def test_other_outputs_depend_on_all_inputs(coupled: str, fmus: dict) -> None:
    unknowns = _root(fmus[coupled]).findall("ModelStructure/Outputs/Unknown")
    # No attribute is FMI's word for that.
    assert unknowns
    assert all("dependencies" not in unknown.attrib for unknown in unknowns)
