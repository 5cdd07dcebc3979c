"""If these fail, an FMU does not say what it is, what it needs, what may be done with it, or where its values sit."""

import io
import re
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from cardiac_cosim.fmus import coordinates as places
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Location
from lxml import etree, html

_ROOT = Path(__file__).parent.parent.parent
_STRUCT = "org.fmi-standard.fmi-ls-struct"
_SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


@pytest.fixture(params=list(UNITS))
def unit(request: pytest.FixtureRequest) -> str:
    return request.param


def _members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.startswith("resources/")}


# --- the page -------------------------------------------------------------------------------------------------------


class _Balance(HTMLParser):
    """Elements that are open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.attributes += attrs
        if tag not in ("meta", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_names_every_variable_once_and_what_is_declared_of_it(unit: str, fmi: int, packed: dict) -> None:
    page = html.fromstring(_members(packed[unit])["documentation/index.html"].decode())
    rows = {row[0].text_content(): row.text_content() for row in page.iter("tr") if row[0].tag == "td"}
    declared = UNITS[unit].variables()
    # A field is one row, however many scalars it is.
    assert sorted(rows) == sorted(variable.name for variable in declared)
    assert len(page.findall(".//tbody/tr")) == len(declared)
    for variable in declared:
        assert variable.description in rows[variable.name]
        assert all(choice in rows[variable.name] for choice in variable.choices)
        assert variable.unit == "1" or variable.unit in rows[variable.name]
    text = page.text_content()
    assert f"FMI {fmi}.0" in text
    assert f"fmi{fmi}Discard" in text
    assert ("fmi2SetRealInputDerivatives" in text) == (UNITS[unit].interpolates and fmi == 2)
    assert ("derivatives of the outputs" in text) == UNITS[unit].differentiable


def test_the_page_tells_the_equations_the_sources_and_the_failures_of_the_unit(fmi: int, packed: dict) -> None:
    text = html.fromstring(_members(packed["active_stress"])["documentation/index.html"].decode()).text_content()
    text = " ".join(text.split())
    for part in ("∂s_a/∂t = ε(Φ)(k(Φ − Φ_r) − s_a)", "How it fails:", "eq. 46", "S. Göktepe, E. Kuhl", "BSD-3-Clause"):
        assert part in text
    # What marks names in docstrings marks them here too, as code.
    assert "`" not in text


def test_the_page_stands_by_itself(unit: str, packed: dict) -> None:
    members = _members(packed[unit])
    page = members["documentation/index.html"].decode()
    parser = _Balance()
    parser.feed(page)
    assert parser.open == []
    assert "<script" not in page
    assert "http" not in page
    for name, value in parser.attributes:
        if name in ("src", "href"):
            path = (Path("/documentation") / str(value)).as_posix()
            assert re.sub(r"/[^/]+/\.\./", "/", path).removeprefix("/") in members


# --- licence, needs, icon -------------------------------------------------------------------------------------------


def test_licence_citation_and_needs_are_inside(unit: str, packed: dict) -> None:
    members = _members(packed[unit])
    assert members["documentation/licenses/license.txt"] == (_ROOT / "LICENSE").read_bytes()
    assert members["documentation/CITATION.cff"] == (_ROOT / "CITATION.cff").read_bytes()
    needs = members["documentation/externalDependencies.txt"].decode()
    for part in ("numpy", "scipy", "scikit-fem", "COSIM_PYTHON", ">=3.11"):
        assert part in needs
    assert "&lt;" not in needs


def test_the_packages_that_are_named_are_those_that_the_carried_code_imports(packed: dict) -> None:
    names = {"numpy": "numpy", "scipy": "scipy", "skfem": "scikit-fem", "meshio": "meshio", "lxml": "lxml"}
    with zipfile.ZipFile(packed["mechanics"]) as archive:
        code = "\n".join(archive.read(name).decode() for name in archive.namelist() if name.endswith(".py"))
        needs = archive.read("documentation/externalDependencies.txt").decode()
    imported = {name for name in names if re.search(rf"^(?:from|import) {name}\b", code, re.MULTILINE)}
    assert {names[name] for name in imported} == {name for name in names.values() if name in needs}


def test_the_icon_is_where_the_standard_looks_for_it(fmi: int, packed: dict) -> None:
    members = _members(packed["mechanics"])
    (path,) = [name for name in members if name.endswith(".png")]
    assert path == ("model.png" if fmi == 2 else "terminalsAndIcons/icon.png")
    assert members[path].startswith(b"\x89PNG")
    width, height = (int.from_bytes(members[path][place : place + 4], "big") for place in (16, 20))
    if fmi == 3:
        drawing = etree.fromstring(members["terminalsAndIcons/icon.svg"])
        assert (drawing.get("width"), drawing.get("height")) == (str(width), str(height))


# --- terminals and coordinates --------------------------------------------------------------------------------------


def _terminals(path: Path) -> etree._Element:
    return etree.fromstring(_members(path)["terminalsAndIcons/terminalsAndIcons.xml"])


def test_the_schema_of_terminals(unit: str, fmus3: dict) -> None:
    schema = etree.XMLSchema(etree.parse(_SCHEMAS / "fmi3TerminalsAndIcons.xsd"))
    assert schema.validate(_terminals(fmus3[unit])), schema.error_log


def test_every_field_is_a_terminal_and_so_are_all_inputs_and_all_outputs(unit: str, fmus3: dict) -> None:
    terminals = {each.get("name"): each for each in _terminals(fmus3[unit]).iter("Terminal")}
    kind = UNITS[unit]
    expected = {field.name: [field.name] for field in (*kind.inputs(), *kind.outputs())}
    expected |= {"outputs": [field.name for field in kind.outputs()]}
    expected |= {"inputs": [field.name for field in kind.inputs()]} if kind.inputs() else {}
    maps = {name for name, each in terminals.items() if each.get("terminalKind", "").startswith(_STRUCT)}
    assert set(terminals) - maps == set(expected)
    for name, members in expected.items():
        assert [member.get("variableName") for member in terminals[name]] == members
        assert [member.get("memberName") for member in terminals[name]] == members
    description = fmpy.read_model_description(str(fmus3[unit]), validate=False)
    known = {variable.name for variable in description.modelVariables}
    assert {member.get("variableName") for each in terminals.values() for member in each} <= known


def test_fields_are_maps_from_the_places_that_the_mesh_has(unit: str, tiny: Mesh, fmus3: dict) -> None:
    description = fmpy.read_model_description(str(fmus3[unit]), validate=False)
    variables = {variable.name: variable for variable in description.modelVariables}
    fields = [*UNITS[unit].inputs(), *UNITS[unit].outputs()]
    points = {Location.NODE: tiny.points, Location.ELEMENT: tiny.points[tiny.cells].mean(axis=1)}
    expected = {f"{place.value}s": place for place in points if any(field.location is place for field in fields)}
    maps = [each for each in _terminals(fmus3[unit]).iter("Terminal") if each.get("matchingRule") == f"{_STRUCT}.map"]
    assert {each.get("name") for each in maps} == set(expected)
    manifest = _members(fmus3[unit]).get(f"extra/{_STRUCT}/fmi-ls-manifest.xml")
    assert (manifest is not None) == bool(expected)
    for each in maps:
        location = expected[each.get("name")]
        assert each.get("terminalKind") == f"{_STRUCT}.map.irregular"
        members: dict[str, list[Any]] = {}
        for member in each:
            members.setdefault(member.get("variableKind").rpartition(".")[2], []).append(
                (member.get("memberName"), variables[member.get("variableName")])
            )
        assert [name for name, _ in members["domain"]] == ["x", "y", "z"]
        found = np.array([axis.start.split() for _, axis in members["domain"]], dtype=float).T
        np.testing.assert_allclose(found, points[location], rtol=0.0, atol=0.5e-6)
        assert {(axis.causality, axis.variability, axis.unit) for _, axis in members["domain"]} == {
            ("local", "constant", "mm")
        }
        # A codomain has one dimension, as many values as there are points.
        assert {value.shape for _, value in members.get("codomain", [])} <= {(len(found),)}
        mapped = {name for kind in ("codomain", "signal") for name, _ in members.get(kind, [])}
        assert mapped == {field.name for field in fields if field.location is location}


def test_the_manifest_is_the_layered_standards(fmus3: dict) -> None:
    manifest = etree.parse(io.BytesIO(_members(fmus3["mechanics"])[f"extra/{_STRUCT}/fmi-ls-manifest.xml"])).getroot()
    space = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert {name.removeprefix(space): value for name, value in manifest.attrib.items()} == {
        "fmi-ls-name": _STRUCT,
        "fmi-ls-version": "1.0.0-rc.1",
        "fmi-ls-description": "Layered standard for structuring of variables",
    }


def test_the_fmu_gives_the_coordinates_that_its_description_has(tiny: Mesh, fmus3: dict, drive: Any) -> None:
    driver = drive(fmus3["mechanics"])
    description = fmpy.read_model_description(str(fmus3["mechanics"]), validate=False)
    constants = [variable for variable in description.modelVariables if variable.causality == "local"]
    assert len(constants) == 6
    for variable in constants:
        np.testing.assert_array_equal(driver.get(variable.name), np.array(variable.start.split(), dtype=float))


def test_many_places_are_left_out(tiny: Mesh, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(places, "MOST_PLACES", tiny.nodes)
    members = _members(build_fmu(UNITS["mechanics"], tiny, tmp_path / "x.fmu", 3))
    assert b'"node_x"' in members["modelDescription.xml"]
    assert b'"element_x"' not in members["modelDescription.xml"] + members["terminalsAndIcons/terminalsAndIcons.xml"]
    monkeypatch.setattr(places, "MOST_PLACES", tiny.nodes - 1)
    members = _members(build_fmu(UNITS["mechanics"], tiny, tmp_path / "y.fmu", 3))
    assert b"_x" not in members["modelDescription.xml"]
    assert not [name for name in members if _STRUCT in name]


@pytest.mark.parametrize("heart", ["mechanics", "electrophysiology"])
def test_an_fmu_runs_as_it_is(heart: str, fmi: int, packed: dict) -> None:
    """Directions start as unit vectors: nothing needs to be connected for a simulation by itself."""
    output = {"mechanics": "lv_volume", "electrophysiology": "potential_mean"}[heart]
    course = fmpy.simulate_fmu(
        str(packed[heart]), stop_time=0.002, step_size=0.001, output_interval=0.001, output=[output]
    )
    assert len(course) == 3
    assert np.isfinite(course[output]).all()
