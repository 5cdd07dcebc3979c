"""If these fail, a file for another tool says something else than the scenario: fields go astray, values are lost."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.fmus.layout import layout
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.ssp.export import write_ssp
from cardiac_cosim.orchestrator.systems.container import write_container
from cardiac_cosim.orchestrator.systems.osp import write_osp
from cardiac_cosim.orchestrator.systems.system import Component, Link, System
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from cardiac_cosim.units.variable import Causality
from lxml import etree

_OSP = {"osp": "http://opensimulationplatform.com/MSMI/OSPSystemStructure"}
_GROUPS = {"osp": "https://open-simulation-platform.com/OspModelDescription/1.0.0"}


def _component(name: str, unit: str, fmu: Path, mesh: Mesh, **given: Any) -> Component:
    shapes: dict[str, dict[str, tuple[int, ...]]] = {each.value: {} for each in Causality}
    for run in layout(UNITS[unit], mesh):
        shapes[run.variable.causality.value][run.variable.name] = run.shape
    return Component(name, fmu, shapes["input"], shapes["output"], given)


@pytest.fixture
def heart(fmus: dict[str, Path], tiny: Mesh) -> System:
    """The loop of the heart on the tiny mesh, with parameters of every type, and two instances of one FMU."""

    def component(name: str, unit: str, **given: Any) -> Component:
        return _component(name, unit, fmus[unit], tiny, **given)

    def link(source: str, target: str, field: str) -> Link:
        components = {item.name: item for item in parts}
        return Link(source, field, target, field, components[source].outputs[field])

    parts = (
        component("fibers", "fiber_generator"),
        component("electro", "electrophysiology", stretch_conductance=0.1, refine=0),
        component("stress", "active_stress", time_integration="exact"),
        component("mechanics", "mechanics"),
        component("idle_stress", "active_stress"),
    )
    links = (
        link("fibers", "electro", "fiber"),
        link("fibers", "mechanics", "fiber"),
        link("fibers", "mechanics", "sheet"),
        link("electro", "stress", "potential"),
        link("electro", "idle_stress", "potential"),
        link("stress", "mechanics", "active_stress"),
        link("mechanics", "electro", "stretch"),
    )
    return System("beat", parts, links, 0.32, 0.001)


# --- libcosim ---------------------------------------------------------------------------------------------------------


def test_osp_has_one_group_and_one_connection_for_a_field(heart: System, tiny: Mesh, tmp_path: Path) -> None:
    structure = etree.parse(write_osp(heart, tmp_path)).getroot()
    sources = {item.get("name"): item.get("source") for item in structure.iterfind(".//osp:Simulator", _OSP)}
    assert list(sources) == [component.name for component in heart.components]
    assert sources["stress"] == sources["idle_stress"] == "active_stress.fmu"
    for source in sources.values():
        assert (tmp_path / source).read_bytes() == next(
            fmu for fmu, name in heart.files.items() if name == source
        ).read_bytes()
    connections = [
        [(end.get("simulator"), end.get("name")) for end in item]
        for item in structure.iterfind(".//osp:VariableGroupConnection", _OSP)
    ]
    assert connections == [[(link.source, link.output), (link.target, link.input)] for link in heart.links]
    # Every group that is connected is there, with all its scalars in the order of the FMU.
    for simulator, group in (end for connection in connections for end in connection):
        description = etree.parse(tmp_path / f"{sources[simulator][:-4]}_OspModelDescription.xml")
        (found,) = description.iterfind(f".//osp:Generic[@name='{group}']", _GROUPS)
        component = heart.component(simulator)
        names = [v.name for v in component.description.modelVariables if v.name.split("[")[0] == group]
        assert [item.get("ref") for item in found] == names
    assert structure.findtext("osp:BaseStepSize", namespaces=_OSP) == "0.001"


def test_osp_gives_parameters_in_their_types(heart: System, tmp_path: Path) -> None:
    structure = etree.parse(write_osp(heart, tmp_path)).getroot()
    given = {
        (simulator.get("name"), value.get("variable")): (etree.QName(value[0]).localname, value[0].get("value"))
        for simulator in structure.iterfind(".//osp:Simulator", _OSP)
        for value in simulator.iterfind(".//osp:InitialValue", _OSP)
    }
    assert given == {
        ("electro", "stretch_conductance"): ("Real", "0.1"),
        ("electro", "refine"): ("Integer", "0"),
        ("stress", "time_integration"): ("String", "exact"),
    }


def test_osp_cannot_tell_fmus_of_one_model_name_apart(heart: System, small_heart: Mesh, tmp_path: Path) -> None:
    other = build_fmu(UNITS["active_stress"], small_heart, tmp_path / "elsewhere" / "active_stress.fmu")
    parts = (*heart.components[:-1], replace(heart.components[-1], fmu=other))
    with pytest.raises(InputError, match="'stress' and 'idle_stress' are both called active_stress"):
        write_osp(replace(heart, components=parts), tmp_path / "out")


# --- fmu-manipulation-toolbox -----------------------------------------------------------------------------------------


def test_a_container_has_one_link_for_a_field(heart: System, tmp_path: Path) -> None:
    path = write_container(heart, tmp_path)
    content = json.loads(path.read_text(encoding="utf-8"))
    assert path.name == "beat.json"
    names = content["path"]
    assert set(content["fmu"]) == set(names)
    assert all((tmp_path / file).is_file() for file in names.values())
    # The second instance of an FMU has a name of its own, and the same file.
    assert names["active_stress.fmu"] == names["idle_stress.fmu"] == "active_stress.fmu"
    assert [link.source for link in heart.links[-2:]] == ["stress", "mechanics"]
    assert content["link"][-2:] == [
        ["active_stress.fmu", "active_stress", "mechanics.fmu", "active_stress"],
        ["mechanics.fmu", "stretch", "electrophysiology.fmu", "stretch"],
    ]
    assert len(content["link"]) == len(heart.links)
    assert ["electrophysiology.fmu", "stretch_conductance", "0.1"] in content["start"]
    assert ["mechanics.fmu", "lv_volume", "mechanics.lv_volume"] in content["output"]
    assert not any(content[rule] for rule in ("auto_link", "auto_input", "auto_output"))


def test_a_container_begins_its_loops_where_nothing_is_right(heart: System, tmp_path: Path) -> None:
    # It initialises the first unit of a loop with zeros, and a stretch of 0 is none.
    order = json.loads(write_container(heart, tmp_path).read_text())["fmu"]
    assert order.index("mechanics.fmu") < order.index("electrophysiology.fmu") < order.index("active_stress.fmu")
    assert order[0] == "fiber_generator.fmu"


@pytest.mark.parametrize("write", [write_osp, write_container])
def test_what_cannot_transform_refuses_to(write: Any, heart: System, tmp_path: Path) -> None:
    links = (replace(heart.links[0], law=(2.0, 0.0)), *heart.links[1:])
    with pytest.raises(InputError, match=r"fibers\.fiber -> electro\.fiber transforms its values"):
        write(replace(heart, links=links), tmp_path)


# --- all of them ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "write", [write_osp, write_container, lambda system, folder: write_ssp(system, folder / "x.ssp")]
)
def test_a_value_for_a_variable_that_is_not_there_is_refused(write: Any, heart: System, tmp_path: Path) -> None:
    wrong = replace(heart.components[1], given={"strech_conductance": 0.1})
    parts = (heart.components[0], wrong, *heart.components[2:])
    with pytest.raises(InputError, match=r"electrophysiology\.fmu of 'electro' has no variable 'strech_conductance'"):
        write(replace(heart, components=parts), tmp_path)


def test_the_same_system_makes_the_same_bytes(heart: System, tmp_path: Path) -> None:
    first, second = (write_ssp(heart, tmp_path / name, "{}", {"mesh.npz": b"x"}) for name in ("a.ssp", "b.ssp"))
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.ssp", "b.ssp"]


def test_fmus_of_one_file_name_stay_apart(heart: System, small_heart: Mesh, tmp_path: Path) -> None:
    other = build_fmu(UNITS["active_stress"], small_heart, tmp_path / "elsewhere" / "active_stress.fmu")
    parts = (*heart.components[:-1], replace(heart.components[-1], fmu=other))
    files = replace(heart, components=parts).files
    assert files[other] == "idle_stress-active_stress.fmu"
    assert len(set(files.values())) == len(files)
