"""If these fail, other tools refuse the FMUs, misread units of measure, or order the coupling by wrong dependencies."""

import math
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from cardiac_cosim.fmus.description import model_description
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality, Variable
from fmpy.validation import validate_fmu
from lxml import etree

# What a user of SI knows of the units: kg, m, s, A, rad, and the factor to the base units.
_SI = {
    "1": ((0, 0, 0, 0, 0), 1.0),
    "deg": ((0, 0, 0, 0, 1), math.pi / 180),
    "mm": ((0, 1, 0, 0, 0), 1e-3),
    "ml": ((0, 3, 0, 0, 0), 1e-6),
    "s": ((0, 0, 1, 0, 0), 1.0),
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

_CALCULATED = ["implementation", "fallbacks"]

_TYPES: dict[int, dict[type, str]] = {
    2: {float: "Real", int: "Integer", str: "String"},
    3: {float: "Float64", int: "Int32", str: "String"},
}


@pytest.fixture(params=list(UNITS))
def unit(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def root(unit: str, packed: dict[str, Path]) -> etree._Element:
    return _root(packed[unit])


@pytest.fixture
def variables(unit: str, packed: dict[str, Path]) -> list[Any]:
    """FMPy's, without the time and the constants of FMI 3.0, of which nothing is declared."""
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    return [item for item in description.modelVariables if item.causality not in ("independent", "local")]


def _root(path: Path) -> etree._Element:
    with zipfile.ZipFile(path) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def _declared(unit: str, name: str) -> Variable:
    return UNITS[unit].variable(name.split("[")[0])


def _names(unit: str, mesh: Mesh, fmi: int, *causalities: Causality) -> list[str]:
    """Of the variables in the FMU, in the order of declaration: in FMI 2.0 those of the scalars."""
    found = []
    for variable in UNITS[unit].variables():
        if variable.causality in causalities:
            shape = variable.shape(mesh)
            if fmi == 3 or not shape:
                found.append(variable.name)
            else:
                places = np.ndindex(*shape)
                found += [f"{variable.name}[{','.join(str(i + 1) for i in index)}]" for index in places]
    return found


# --- by the standard ------------------------------------------------------------------------------------------------


def test_fmpy_has_nothing_to_say(unit: str, packed: dict) -> None:
    assert validate_fmu(str(packed[unit])) == []


def test_fmpy_accepts_the_baseline_heart(unit: str, baseline: Mesh, baseline_fmus: dict) -> None:
    # Without the names, for which FMPy takes minutes; they are made by the same rule on the tiny mesh.
    description = fmpy.read_model_description(
        str(baseline_fmus[unit]), validate=True, validate_variable_names=False, validate_model_structure=True
    )
    count = len(_names(unit, baseline, 2, Causality.OUTPUT))
    assert (len(description.outputs), len(description.initialUnknowns)) == (count, count + len(_CALCULATED))


def test_the_schema_of_the_standard(root: etree._Element, fmi: int) -> None:
    schemas = Path(fmpy.__file__).parent / "schema" / f"fmi{fmi}"
    schema = etree.XMLSchema(etree.parse(schemas / f"fmi{fmi}ModelDescription.xsd"))
    assert schema.validate(root), schema.error_log
    assert root.get("fmiVersion") == f"{fmi}.0"


def test_what_the_fmu_can_do(unit: str, root: etree._Element, fmi: int) -> None:
    kind = UNITS[unit]
    (element,) = root.findall("CoSimulation")
    flags = {"needsExecutionTool": False, "canBeInstantiatedOnlyOncePerProcess": False}
    flags |= {"canHandleVariableCommunicationStepSize": True}
    if fmi == 2:
        flags |= dict.fromkeys(
            ("canNotUseMemoryManagementFunctions", "canGetAndSetFMUstate", "canSerializeFMUstate"), True
        )
        flags |= {"canInterpolateInputs": kind.interpolates, "providesDirectionalDerivative": kind.differentiable}
    else:
        flags |= {"canGetAndSetFMUState": True, "canSerializeFMUState": True}
        flags |= {"providesIntermediateUpdate": kind.interpolates}
        flags |= dict.fromkeys(("providesDirectionalDerivatives", "providesAdjointDerivatives"), kind.differentiable)
    assert element.get("modelIdentifier") == unit
    # What is not said is false.
    told = {name: value == "true" for name, value in element.attrib.items() if name != "modelIdentifier"}
    assert dict.fromkeys(flags, False) | told == flags


def test_some_units_have_derivatives_and_some_run_to_the_ends_of_their_inputs() -> None:
    # Otherwise the test above would have nothing to tell apart.
    assert len({unit.differentiable for unit in UNITS.values()}) == 2
    assert len({unit.interpolates for unit in UNITS.values()}) == 2


# --- variables ------------------------------------------------------------------------------------------------------


def test_the_variables_are_those_of_the_declaration(
    unit: str, tiny: Mesh, fmi: int, packed: dict, variables: list[Any]
) -> None:
    assert [item.name for item in variables] == _names(unit, tiny, fmi, *Causality)
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    references = [item.valueReference for item in description.modelVariables]
    assert len(set(references)) == len(references)
    for found in variables:
        meant = _declared(unit, found.name)
        assert found.causality == meant.causality.value
        assert found.type == _TYPES[fmi][type(meant.start)]
        assert found.shape == (meant.shape(tiny) if fmi == 3 else ())
        assert found.description == meant.description != ""
        assert found.unit == (meant.unit if isinstance(meant.start, float) else None)
        if meant.causality in (Causality.PARAMETER, Causality.CALCULATED_PARAMETER):
            assert found.variability == "fixed"
        else:
            assert found.variability == ("discrete" if meant.fixed else "continuous")
        assert (found.min is None) == (meant.at_least is None)
        assert found.min is None or float(found.min) == meant.at_least


def test_start_values_are_those_that_the_unit_starts_with(unit: str, tiny: Mesh, variables: list[Any]) -> None:
    fresh = UNITS[unit](tiny)
    given: dict[str, list[str]] = {}
    for found in variables:
        meant = _declared(unit, found.name)
        assert (found.start is None) == (meant.causality not in (Causality.INPUT, Causality.PARAMETER)), found.name
        if found.start is not None:
            texts = [found.start] if isinstance(meant.start, str) else found.start.split()
            # Of an array, one value for all of its elements, or each one's.
            assert len(texts) in (1, math.prod(found.shape)), found.name
            given.setdefault(meant.name, []).extend(texts)
    for name, texts in given.items():
        kind = type(_declared(unit, name).start)
        value = fresh.get(name)
        if np.shape(value):
            read = np.array(texts, dtype=float)
            np.testing.assert_array_equal(
                np.broadcast_to(read, value.size if read.size == 1 else read.size), value.ravel()
            )
        else:
            # The very same value, to the last bit.
            assert [kind(text) for text in texts] == [value]


def test_a_start_value_keeps_all_its_digits(tiny: Mesh, fmi: int) -> None:
    potential, *others = ActiveStress.fields

    class Other(ActiveStress):
        """Another."""

        fields = (replace(potential, start=-100.0 / 3.0), *others)

    root = etree.fromstring("".join(model_description(Other, tiny, "{0}", fmi)).encode())
    path = "//ScalarVariable[@name='potential[1]']/Real/@start" if fmi == 2 else "//Float64[@name='potential']/@start"
    (start,) = root.xpath(path)
    assert float(start) == -100.0 / 3.0


def test_fmi_3_has_the_time_and_says_which_inputs_may_change_inside_a_step(unit: str, fmus3: dict) -> None:
    root = _root(fmus3[unit])
    (time,) = root.xpath("ModelVariables/*[@causality='independent']")
    assert (time.tag, time.get("name"), time.get("unit"), time.get("valueReference")) == ("Float64", "time", "s", "0")
    moving = {item.name for item in UNITS[unit].inputs() if not item.fixed} if UNITS[unit].interpolates else set()
    assert set(root.xpath("ModelVariables/*[@intermediateUpdate='true']/@name")) == moving


def test_what_a_unit_computes_with_is_calculated_once(variables: list[Any]) -> None:
    found = [item for item in variables if item.name in _CALCULATED]
    kinds = {(item.type, item.causality, item.variability, item.initial, item.start) for item in found}
    assert (len(found), kinds) == (2, {("String", "calculatedParameter", "fixed", "calculated", None)})


# --- units of measure -----------------------------------------------------------------------------------------------


def test_every_real_has_a_unit_that_is_defined_in_si(unit: str, fmi: int, packed: dict) -> None:
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    reals = [variable for variable in description.modelVariables if variable.type == _TYPES[fmi][float]]
    assert len(reals) > 3
    defined = {item.name: item.baseUnit for item in description.unitDefinitions}
    # The time's and the coordinates' are there in every FMU of FMI 3.0.
    assert set(defined) - {variable.unit for variable in reals} <= ({"mm"} if fmi == 3 else set())
    assert {variable.unit for variable in reals} <= set(defined)
    for name, base in defined.items():
        exponents, factor = _SI[name]
        assert (base.kg, base.m, base.s, base.A, base.rad) == exponents, name
        assert (base.K, base.mol, base.cd, base.offset) == (0, 0, 0, 0), name
        assert base.factor == pytest.approx(factor, rel=1e-15), name


def test_names_of_parameters_end_in_their_unit(unit: str, variables: list[Any]) -> None:
    seen = 0
    for variable in variables:
        if variable.type in ("Real", "Float64") and variable.causality == "parameter":
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
    assert {v.unit for v in (*times, *activation)} == {"ms"}


# --- what depends on what -------------------------------------------------------------------------------------------


def test_outputs_are_exactly_the_outputs_and_initial_unknowns_all_that_is_computed(
    unit: str, tiny: Mesh, fmi: int, packed: dict
) -> None:
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    expected = _names(unit, tiny, fmi, Causality.OUTPUT)
    assert [unknown.variable.name for unknown in description.outputs] == expected
    assert [unknown.variable.name for unknown in description.initialUnknowns] == [*expected, *_CALCULATED]


def test_outputs_follow_the_inputs_that_are_declared(unit: str, fmi: int, packed: dict) -> None:
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    inputs = {variable.name for variable in UNITS[unit].inputs()}
    parameters = {item.name for item in description.modelVariables if item.causality == "parameter"}
    for output in description.outputs:
        declared = set(_declared(unit, output.variable.name).depends_on)
        if output.dependencies is None:
            # No attribute is FMI's word for a dependence on everything.
            assert declared == inputs
        else:
            named = {item.name.split("[")[0] for item in output.dependencies}
            assert named & inputs == declared
            # FMI 3.0 counts the parameters among what is known after the initialization, FMI 2.0 does not.
            assert named - inputs == (parameters if fmi == 3 else set())
        # No list would be a dependence on everything, fibres on the time too.
        assert inputs or output.dependencies is not None


def test_what_a_unit_computes_with_follows_its_parameters(unit: str, packed: dict) -> None:
    description = fmpy.read_model_description(str(packed[unit]), validate=False)
    parameters = [item.name for item in description.modelVariables if item.causality == "parameter"]
    *_, one, other = description.initialUnknowns
    assert [item.name for item in one.dependencies] == [item.name for item in other.dependencies] == parameters


def test_lists_of_dependencies_are_sorted(unit: str, fmus: dict) -> None:
    for element in _root(fmus[unit]).iter("Unknown"):
        indices = [int(index) for index in element.get("dependencies", "").split()]
        assert indices == sorted(indices)


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


# --- beyond the standard --------------------------------------------------------------------------------------------


def test_annotations_are_the_same_in_both_versions_and_in_a_namespace_of_their_own(
    unit: str, fmus: dict, fmus3: dict
) -> None:
    (two,) = _root(fmus[unit]).find("VendorAnnotations/Tool[@name='cardiac-cosim']")
    (three,) = _root(fmus3[unit]).find("Annotations/Annotation[@type='cardiac-cosim']")
    assert etree.tostring(two).strip() == etree.tostring(three).strip()
    assert {etree.QName(element).namespace for element in two.iter()} == {"urn:cardiac-cosim:fmu"}
    assert len(two) == len((*UNITS[unit].inputs(), *UNITS[unit].outputs()))
