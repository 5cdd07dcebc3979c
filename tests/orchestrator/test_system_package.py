"""If these fail, a scenario that goes through a system package comes out as another one, or other people's systems run
otherwise than they wrote them."""

import json
import re
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_body
import h5py
import numpy as np
import pytest
from cardiac_cosim.orchestrator import ssp, stopping
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.ssp import open_package
from fmpy.ssp import simulation
from fmpy.ssp.ssd import read_ssd
from lxml import etree

_ROOT = Path(__file__).parent.parent.parent
_SCENARIOS = _ROOT / "scenarios"
_SCHEMAS = Path(ssp.__file__).parent / "schemas"
_COARSE = ("scene.mesh_size_mm=4", "run.stop_ms=20")

Cosim = Callable[..., Any]


def _set(*assignments: str) -> list[str]:
    return [word for assignment in assignments for word in ("--set", assignment)]


def _package(cosim: Cosim, scenario: Path, folder: Path, *assignments: str, fmi: int = 2) -> Path:
    ended = cosim("build", scenario, "--output", folder, "--ssp", "--fmi", str(fmi), *_set(*assignments))
    assert ended.code == 0, ended.err
    (path,) = folder.glob("*.ssp")
    assert str(path) in ended.out.splitlines()
    return path


def _fields(folder: Path) -> dict[str, np.ndarray]:
    found: dict[str, np.ndarray] = {}
    with h5py.File(folder / "fields.h5") as file:
        file.visititems(lambda name, item: found.update({name: item[:]} if isinstance(item, h5py.Dataset) else {}))
    return found


# --- our own packages -------------------------------------------------------------------------------------------------


_ITERATED = "coupling.iterate={acceleration: anderson, converge: {stretch: {relative: 1e-6}}}"


@pytest.mark.parametrize(
    ("scene", "assignments", "fmi"),
    [
        ("cell", ("run.stop_ms=30",), 2),
        ("cell", ("run.stop_ms=30",), 3),
        ("strand", _COARSE, 2),
        ("strand", _COARSE, 3),
        (
            "strand",
            (*_COARSE, "coupling.scheme=jacobi", "coupling.interpolation=linear", "coupling.extrapolation=1"),
            2,
        ),
        (
            "strand",
            (*_COARSE, "units.mechanics.every=4", "coupling.order=[mechanics, electrophysiology, active_stress]"),
            3,
        ),
        ("strand", (*_COARSE, "coupling.adaptive={tolerance: 0.05, min_ms: 0.5, max_ms: 5}"), 2),
        ("strand", (*_COARSE, _ITERATED), 2),
        ("strand", (*_COARSE, _ITERATED, "coupling.interpolation=linear"), 3),
    ],
)
def test_a_scenario_runs_from_its_package_to_the_same_bits(
    scene: str, assignments: tuple[str, ...], fmi: int, cosim: Cosim, tmp_path: Path
) -> None:
    scenario = _SCENARIOS / f"{scene}.yaml"
    package = _package(cosim, scenario, tmp_path / "built", *assignments, fmi=fmi)
    for source, name, sets in ((scenario, "yaml", assignments), (package, "ssp", ())):
        ended = cosim("run", source, "--output", tmp_path / name, *_set(*sets))
        assert ended.code == 0, ended.err
        assert ended.err == ""
    series = [(tmp_path / name / "timeseries.csv").read_bytes() for name in ("yaml", "ssp")]
    assert series[0] == series[1]
    before, after = _fields(tmp_path / "yaml"), _fields(tmp_path / "ssp")
    assert before.keys() == after.keys()
    for name, values in before.items():
        np.testing.assert_array_equal(values, after[name], err_msg=name)


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_package_of_a_package_is_the_same_package(fmi: int, cosim: Cosim, tmp_path: Path) -> None:
    first = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "first", *_COARSE, fmi=fmi)
    again = _package(cosim, first, tmp_path / "again")
    assert first.read_bytes() == again.read_bytes()


def test_a_package_can_be_changed(cosim: Cosim, tmp_path: Path) -> None:
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *_COARSE)
    changes = _set("coupling.step_ms=5", "units.active_stress.parameters={length_dependence: 0.5}")
    # Then the unit has an input that matters, and the package has no connection to it.
    changes += _set("connections=[mechanics.stretch -> active_stress.stretch]", "connect_by_name=true")
    for source, name, sets in ((package, "ssp", ()), (_SCENARIOS / "strand.yaml", "yaml", _COARSE)):
        ended = cosim("run", source, "--output", tmp_path / name, *_set(*sets), *changes)
        assert ended.code == 0, ended.err
    series = [(tmp_path / name / "timeseries.csv").read_bytes() for name in ("ssp", "yaml")]
    assert series[0] == series[1]


def test_a_run_from_a_package_is_continued_after_an_interruption(
    cosim: Cosim, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *_COARSE)
    sets = _set("run.checkpoint_every=5")
    assert cosim("run", package, "--output", tmp_path / "whole", *sets).code == 0
    # Stopped after its seventh step, as if by a signal.
    asked = iter([False] * 7 + [True] * 100)
    monkeypatch.setattr(stopping.StopRequest, "__bool__", lambda self: _ask(self, next(asked)))
    assert cosim("run", package, "--output", tmp_path / "half", *sets).code > 128
    monkeypatch.undo()
    ended = cosim("run", package, "--output", tmp_path / "half", *sets, "--resume")
    assert ended.code == 0, ended.err
    series = [(tmp_path / name / "timeseries.csv").read_bytes() for name in ("whole", "half")]
    assert series[0] == series[1]


def _ask(request: Any, stop: bool) -> bool:
    request.signal = 2 if stop else None
    return stop


def test_another_tool_may_change_what_the_standard_has_a_place_for(cosim: Cosim, tmp_path: Path) -> None:
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *_COARSE)
    changed = _changed(package, tmp_path / "changed.ssp", ('stopTime="0.02"', 'stopTime="0.01"'))
    with open_package(changed) as (scenario, _):
        assert scenario.run.stop_ms == 10.0
        assert scenario.coupling.step_ms == 1.0


def test_packages_follow_the_standard(cosim: Cosim, tmp_path: Path) -> None:
    sets = (
        *_COARSE,
        "units.electrophysiology.parameters.refine=1",
        "units.active_stress.parameters.time_integration=exact",
    )
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *sets)
    # FMPy validates it, and the parameter sets, against the schemas of SSP 1.0.
    ssd = read_ssd(str(package), validate=True)
    components = {component.name: component for component in ssd.system.elements}
    assert list(components) == ["fibers", "electrophysiology", "active_stress", "mechanics"]
    assert ssd.system.connectors == []
    assert len(ssd.system.connections) == 15 * 3 * 3 + 16 + 16 + 15
    ends = {(c.startElement, c.startConnector, c.endElement, c.endConnector) for c in ssd.system.connections}
    assert ("fibers", "fiber[15,3]", "electrophysiology", "fiber[15,3]") in ends
    assert ("electrophysiology", "potential[16]", "active_stress", "potential[16]") in ends
    given = {
        (component.name, parameter.name): (parameter.type, parameter.value, parameter.unit)
        for component in components.values()
        for binding in component.parameterBindings
        for values in binding.parameterValues
        for parameter in values.parameters
    }
    assert given == {
        ("electrophysiology", "time_scale_reduction"): ("Real", "0.0", "1"),
        ("electrophysiology", "stimulus_x_min_mm"): ("Real", "-1.0", "mm"),
        ("electrophysiology", "stimulus_x_max_mm"): ("Real", "8.0", "mm"),
        ("electrophysiology", "refine"): ("Integer", "1", None),
        ("active_stress", "time_integration"): ("String", "exact", None),
    }
    units = {unit.name: unit for unit in ssd.units}
    assert (units["mV"].kg, units["mV"].m, units["mV"].s, units["mV"].A, units["mV"].factor) == (1, 2, -3, -1, 1e-3)
    with zipfile.ZipFile(package) as archive:
        text = archive.read("SystemStructure.ssd").decode()
        shown = set(re.findall(r'<ssc:Real unit="([^"]+)"', text))
    assert shown <= units.keys()
    # FMPy connects an input that nothing feeds to whatever it connected last.
    fed = {(element, connector) for _, _, element, connector in ends}
    inputs = {(c.name, k.name) for c in components.values() for k in c.connectors if k.kind == "input"}
    assert inputs == fed


def test_packages_of_fmi_3_follow_the_standard(cosim: Cosim, tmp_path: Path) -> None:
    sets = (
        *_COARSE,
        "units.electrophysiology.parameters.refine=1",
        "units.active_stress.parameters.time_integration=exact",
    )
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *sets, fmi=3)
    with zipfile.ZipFile(package) as archive:
        texts = {name: archive.read(name) for name in archive.namelist() if name.endswith((".ssd", ".ssv"))}
    roots = {name: etree.fromstring(text) for name, text in texts.items()}
    assert len(roots) == 3
    for name, root in roots.items():
        kind = "Description" if name.endswith(".ssd") else "ParameterValues"
        etree.XMLSchema(file=str(_SCHEMAS / f"SystemStructure{kind}.xsd")).assertValid(root)
        assert root.get("version") == "2.0"
    structure = roots["SystemStructure.ssd"]
    ends = ("startElement", "startConnector", "endElement", "endConnector")
    assert {tuple(map(each.get, ends)) for each in structure.iterfind(".//{*}Connection")} == {
        ("mechanics", "stretch", "electrophysiology", "stretch"),
        ("fibers", "fiber", "electrophysiology", "fiber"),
        ("fibers", "fiber", "mechanics", "fiber"),
        ("fibers", "sheet", "mechanics", "sheet"),
        ("electrophysiology", "potential", "active_stress", "potential"),
        ("active_stress", "active_stress", "mechanics", "active_stress"),
    }
    (fiber,) = structure.iterfind(".//{*}Component[@name='fibers']//{*}Connector[@name='fiber']")
    assert [(etree.QName(each).localname, dict(each.attrib)) for each in fiber][:3] == [
        ("Float64", {"unit": "1"}),
        ("Dimension", {"size": "15"}),
        ("Dimension", {"size": "3"}),
    ]
    given = {
        (name, parameter.get("name")): (etree.QName(parameter[0]).localname, dict(parameter[0].attrib))
        for name, root in roots.items()
        for parameter in root.iterfind(".//{*}Parameter")
    }
    assert given == {
        ("resources/electrophysiology.ssv", "time_scale_reduction"): ("Float64", {"value": "0.0", "unit": "1"}),
        ("resources/electrophysiology.ssv", "stimulus_x_min_mm"): ("Float64", {"value": "-1.0", "unit": "mm"}),
        ("resources/electrophysiology.ssv", "stimulus_x_max_mm"): ("Float64", {"value": "8.0", "unit": "mm"}),
        ("resources/electrophysiology.ssv", "refine"): ("Int32", {"value": "1"}),
        ("resources/active_stress.ssv", "time_integration"): ("String", {"value": "exact"}),
    }


@pytest.mark.parametrize("fmi", [2, 3])
def test_components_do_not_lie_on_each_other(fmi: int, cosim: Cosim, tmp_path: Path) -> None:
    package = _package(cosim, _SCENARIOS / "strand.yaml", tmp_path / "built", *_COARSE, fmi=fmi)
    with zipfile.ZipFile(package) as archive:
        root = etree.fromstring(archive.read("SystemStructure.ssd"))
    boxes = {
        part.get("name"): [float(part.find("{*}ElementGeometry").get(side)) for side in ("x1", "y1", "x2", "y2")]
        for part in root.iterfind(".//{*}Component")
    }
    # One behind the other, in the order of execution, and on the canvas.
    (canvas,) = root.iterfind(".//{*}SystemGeometry")
    edges = [x for name in ("fibers", "electrophysiology", "active_stress", "mechanics") for x in boxes[name][::2]]
    assert edges == sorted(edges)
    assert float(canvas.get("x1")) < edges[0]
    assert edges[-1] < float(canvas.get("x2"))
    for connector in root.iterfind(".//{*}Connector"):
        place = connector.find("{*}ConnectorGeometry")
        assert place.get("x") == {"input": "0.0", "output": "1.0"}[connector.get("kind")]
        assert 0.0 < float(place.get("y")) < 1.0
    assert all(each.find("{*}ConnectionGeometry") is not None for each in root.iterfind(".//{*}Connection"))


# --- FMPy -------------------------------------------------------------------------------------------------------------


def _example() -> str:
    """The lines of the page that make good for what FMPy lacks."""
    text = (_ROOT / "docs" / "ssp.md").read_text(encoding="utf-8")
    return next(code for code in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if "simulate_ssp" in code)


@pytest.mark.parametrize(("scene", "nodes"), [("cell", 1), ("strand", 16)])
def test_fmpy_and_the_lines_of_the_page_give_our_trajectory(
    scene: str, nodes: int, cosim: Cosim, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assignments = ("run.stop_ms=50", "output.every_ms=1", *(("scene.mesh_size_mm=4",) if scene == "strand" else ()))
    package = _package(cosim, _SCENARIOS / f"{scene}.yaml", tmp_path, *assignments)
    lines = _example().replace("my-fmus/strand.ssp", str(package)).replace("potential[16]", f"potential[{nodes}]")
    # The lines replace it for good.
    monkeypatch.setattr(simulation, "instantiate_fmu", simulation.instantiate_fmu)
    names: dict[str, Any] = {}
    exec(lines, names)
    sets = _set("coupling.scheme=jacobi", "run.participants=native", *assignments)
    assert cosim("run", _SCENARIOS / f"{scene}.yaml", "--output", tmp_path / "ours", *sets).code == 0
    ours, rows = _fields(tmp_path / "ours"), names["rows"]
    # FMPy's rows are named after the begin of their step.
    for field, count, column in (
        ("potential_mV", nodes, "electrophysiology.potential[{}]"),
        ("stretch", max(nodes - 1, 1), "mechanics.stretch[{}]"),
    ):
        theirs = np.stack([rows[column.format(place + 1)] for place in range(count)], axis=1)
        np.testing.assert_allclose(theirs[:50], ours[f"frames/{field}"][1:51], rtol=1e-12, atol=1e-12)
    assert np.ptp(ours["frames/potential_mV"]) > 20.0


def test_fmpy_alone_cannot_begin_a_heart(cosim: Cosim, tmp_path: Path) -> None:
    # If this fails, FMPy has learned to exchange initial values: then shorten the page.
    package = _package(cosim, _SCENARIOS / "cell.yaml", tmp_path, "run.stop_ms=30")
    with pytest.raises(Exception, match="fmi2SetReal failed with status 3"):
        simulation.simulate_ssp(str(package), stop_time=0.03, step_size=0.001)


# --- other people's packages ------------------------------------------------------------------------------------------

needs_compiler = pytest.mark.skipif(build_body.compiler() is None, reason="no C compiler to build foreign FMUs with")

_SSD = """\
<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription version="1.0" name="two masses"
    xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
    xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
    xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">
  <ssd:System name="system">
    <ssd:ParameterBindings>
      <ssd:ParameterBinding source="resources/second%20mass.ssv" prefix="second."/>
    </ssd:ParameterBindings>
    <ssd:Elements>
      <ssd:Component name="first" source="resources/mass.fmu">
        <ssd:Connectors>
          <ssd:Connector name="F_in" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="x" kind="output"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="v" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings>
          <ssd:ParameterBinding>
            <ssd:ParameterValues>
              <ssv:ParameterSet version="1.0" name="first">
                <ssv:Parameters>
                  <ssv:Parameter name="k"><ssv:Real value="10"/></ssv:Parameter>
                  <ssv:Parameter name="c"><ssv:Integer value="7"/></ssv:Parameter>
                  <ssv:Parameter name="x"><ssv:Real value="1"/></ssv:Parameter>
                </ssv:Parameters>
              </ssv:ParameterSet>
            </ssd:ParameterValues>
          </ssd:ParameterBinding>
          <ssd:ParameterBinding source="resources/damping.ssv"/>
        </ssd:ParameterBindings>
      </ssd:Component>
      <ssd:Component name="second" source="resources/mass.fmu" implementation="CoSimulation">
        <ssd:Connectors>
          <ssd:Connector name="x_in" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="v_in" kind="input"><ssc:Real/></ssd:Connector>
          <ssd:Connector name="F" kind="output"><ssc:Real/></ssd:Connector>
        </ssd:Connectors>
        <ssd:ParameterBindings>
          <ssd:ParameterBinding source="resources/damping.ssv"/>
        </ssd:ParameterBindings>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startElement="first" startConnector="x" endElement="second" endConnector="x_in"/>
      <ssd:Connection startElement="second" startConnector="v_in" endElement="first" endConnector="v"/>
      <ssd:Connection startElement="second" startConnector="F" endElement="first" endConnector="F_in"/>
    </ssd:Connections>
  </ssd:System>
  <ssd:DefaultExperiment startTime="0" stopTime="2"/>
</ssd:SystemStructureDescription>
"""


def _ssv(**values: float) -> str:
    parameters = "".join(
        f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"/></ssv:Parameter>' for name, value in values.items()
    )
    return (
        '<ssv:ParameterSet version="1.0" name="set" '
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues">'
        f"<ssv:Parameters>{parameters}</ssv:Parameters></ssv:ParameterSet>"
    )


_SETS = {
    "resources/damping.ssv": _ssv(c=0.2),
    "resources/second mass.ssv": _ssv(k=20, c=0.3, k_c=10, c_c=0.5, x=0.5),
}

#: The same two masses as a scenario.
_SCENARIO = """\
name: two_masses
units:
  first: {fmu: mass.fmu, parameters: {k: 10, c: 0.2}, start: {x: 1}}
  second: {fmu: mass.fmu, parameters: {k: 20, c: 0.3, k_c: 10, c_c: 0.5}, start: {x: 0.5}}
connections: [first.x -> second.x_in, first.v -> second.v_in, second.F -> first.F_in]
coupling: {scheme: jacobi, step_ms: 10}
run: {stop_ms: 2000}
output: {every_ms: 2000}
"""


@pytest.fixture(scope="session")
def mass(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU in C: a mass on a spring."""
    return build_body.build_body(tmp_path_factory.mktemp("mass") / "mass.fmu")


@pytest.fixture
def masses(tmp_path: Path, mass: Path) -> Path:
    """A package that no tool of ours wrote."""
    path = tmp_path / "masses.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", _SSD)
        archive.write(mass, "resources/mass.fmu")
        for name, text in _SETS.items():
            archive.writestr(name, text)
    return path


def _changed(package: Path, path: Path, *changes: tuple[str, str], **files: str) -> Path:
    """The package with its structure changed, and with other files: names with `__` for `/`."""
    others = {name.replace("__", "/").replace("_dot_", "."): text for name, text in files.items()}
    with zipfile.ZipFile(package) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "SystemStructure.ssd":
                text = content.decode()
                for before, after in changes:
                    assert before in text, before
                    text = text.replace(before, after)
                content = text.encode()
            new.writestr(name, others.pop(name, content))
        for name, text in others.items():
            new.writestr(name, text)
    return path


def _series(folder: Path) -> np.ndarray:
    return np.genfromtxt(folder / "timeseries.csv", delimiter=",", names=True)


@needs_compiler
def test_a_foreign_package_runs_as_the_scenario_that_it_is(
    masses: Path, mass: Path, cosim: Cosim, tmp_path: Path
) -> None:
    shutil.copyfile(mass, tmp_path / "mass.fmu")
    (tmp_path / "masses.yaml").write_text(_SCENARIO)
    sets = _set("coupling.scheme=jacobi", "coupling.step_ms=10")
    for source, name in ((masses, "ssp"), (tmp_path / "masses.yaml", "yaml")):
        ended = cosim("run", source, "--output", tmp_path / name, *sets)
        assert ended.code == 0, ended.err
        assert ended.err == ""
    np.testing.assert_array_equal(_series(tmp_path / "ssp"), _series(tmp_path / "yaml"))
    shown = cosim("show", masses)
    assert "first.v -> second.v_in" in shown.out
    assert "first: resources/mass.fmu" in shown.out


@needs_compiler
def test_what_a_package_does_not_say(masses: Path, tmp_path: Path) -> None:
    with open_package(masses) as (scenario, base):
        assert scenario.name == "two_masses"
        assert scenario.run.stop_ms == 2000.0
        # The FMU proposes no step: a hundredth.
        assert scenario.coupling.step_ms == 20.0
        assert scenario.coupling.scheme == "gauss-seidel"
        assert (base / scenario.units["first"].fmu).is_file()
        # `c` of the component's last set goes before the first one's; the system's before both.
        assert scenario.units["first"].parameters == {"k": 10.0, "c": 0.2}
        assert scenario.units["second"].parameters == {"k": 20.0, "c": 0.3, "k_c": 10.0, "c_c": 0.5}
        # An input of a name that some output has is not connected for that.
        assert not scenario.connect_by_name
    assert not base.exists()
    longer = _changed(masses, tmp_path / "none.ssp", ('<ssd:DefaultExperiment startTime="0" stopTime="2"/>', ""))
    with pytest.raises(InputError, match=r"no stop time; give one by --set run\.stop_ms="), open_package(longer):
        pass
    with open_package(longer, ["run.stop_ms=100"]) as (scenario, _):
        assert scenario.run.stop_ms == 100.0


@needs_compiler
def test_the_smallest_step_that_an_fmu_proposes_is_taken(masses: Path, mass: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(mass) as old, zipfile.ZipFile(tmp_path / "hasty.fmu", "w") as new:
        for name in old.namelist():
            text = old.read(name)
            if name == "modelDescription.xml":
                text = text.replace(b"<ModelVariables>", b'<DefaultExperiment stepSize="0.003"/><ModelVariables>')
            new.writestr(name, text)
    hasty = _changed(
        masses,
        tmp_path / "hasty.ssp",
        ('name="first" source="resources/mass.fmu"', 'name="first" source="resources/hasty.fmu"'),
    )
    with zipfile.ZipFile(hasty, "a") as archive:
        archive.write(tmp_path / "hasty.fmu", "resources/hasty.fmu")
    with open_package(hasty) as (scenario, _):
        # No longer than proposed, and a whole number of them.
        assert scenario.coupling.step_ms == pytest.approx(2000.0 / 667)


@needs_compiler
def test_names_that_no_scenario_may_have(masses: Path, cosim: Cosim, tmp_path: Path) -> None:
    odd = _changed(
        masses,
        tmp_path / "odd.ssp",
        ('name="first"', 'name="1st mass"'),
        ('startElement="first"', 'startElement="1st mass"'),
        ('endElement="first"', 'endElement="1st mass"'),
    )
    with open_package(odd) as (scenario, _):
        assert list(scenario.units) == ["x1st_mass", "second"]
        assert "x1st_mass.x -> second.x_in" in scenario.connections
    assert cosim("run", odd, "--output", tmp_path / "out").code == 0


@needs_compiler
def test_a_linear_transformation_is_applied(masses: Path, cosim: Cosim, tmp_path: Path) -> None:
    # Both masses hang on one spring, described from a place 0.25 m to the left, in decimetres.
    law = '<ssc:LinearTransformation factor="0.1" offset="-0.25"/>'
    moved = _changed(
        masses,
        tmp_path / "moved.ssp",
        (
            'endElement="second" endConnector="x_in"/>',
            f'endElement="second" endConnector="x_in">{law}</ssd:Connection>',
        ),
    )
    with open_package(moved) as (scenario, _):
        assert scenario.connections[0] == "first.x * 0.1 + -0.25 -> second.x_in"
    assert cosim("run", moved, "--output", tmp_path / "moved").code == 0
    assert cosim("run", masses, "--output", tmp_path / "still").code == 0
    assert _series(tmp_path / "moved")["secondx"][-1] != _series(tmp_path / "still")["secondx"][-1]
    # And it is written again.
    again = _package(cosim, moved, tmp_path / "again")
    with open_package(again) as (scenario, _):
        assert scenario.connections[0] == "first.x * 0.1 + -0.25 -> second.x_in"
    for option in ("--osp", "--container"):
        ended = cosim("build", moved, option, "--output", tmp_path / "other")
        assert ended.code == 2
        assert "first.x -> second.x_in transforms its values" in ended.err


@needs_compiler
def test_fmpy_alone_and_a_system_that_begins_at_zero(masses: Path, cosim: Cosim, tmp_path: Path) -> None:
    # Two masses at rest; one is drawn by a force that nothing feeds, so that it keeps its start value.
    sets = _set(
        "units.first.start={}",
        "units.second.start={F_in: 1.5}",
        "run.stop_ms=500",
        "coupling.scheme=jacobi",
        "coupling.step_ms=10",
    )
    ours = cosim("run", masses, "--output", tmp_path / "ours", *sets)
    assert ours.code == 0, ours.err
    package = tmp_path / "built" / "two_masses.ssp"
    assert cosim("build", masses, "--ssp", "--output", tmp_path / "built", *sets).code == 0
    values = _prefixed(package)
    rows = simulation.simulate_ssp(str(package), stop_time=0.5, step_size=0.01, parameter_set=values)
    series = _series(tmp_path / "ours")
    for column, theirs in (("firstx", "first.x"), ("firstv", "first.v"), ("secondF", "second.F")):
        np.testing.assert_allclose(rows[theirs][:50], series[column][1:51], rtol=1e-12, atol=1e-14)
    assert abs(series["firstx"]).max() > 1e-3


def _prefixed(package: Path) -> Any:
    """The package's parameters as FMPy wants to be given them: it does not look into the bindings."""
    ssd = read_ssd(str(package))
    whole = None
    for component in ssd.system.elements:
        for binding in component.parameterBindings:
            for values in binding.parameterValues:
                for parameter in values.parameters:
                    parameter.name = f"{component.name}.{parameter.name}"
                if whole is None:
                    whole = values
                else:
                    whole.parameters += values.parameters
    return whole


# --- what is not supported, or wrong ----------------------------------------------------------------------------------

_NESTED = '<ssd:System name="inner"/>'
_MAPPED = (
    'endConnector="x_in"><ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
    "</ssc:IntegerMappingTransformation></ssd:Connection>"
)
_OUTSIDE = '<ssd:Connection startConnector="u" endElement="second" endConnector="v_in"/>'


@needs_compiler
@pytest.mark.parametrize(
    ("changes", "files", "words"),
    [
        (
            [("</ssd:Elements>", f"{_NESTED * 2}</ssd:Elements>")],
            {},
            ["the system has two elements 'inner'", "rename one"],
        ),
        (
            [("</ssd:Elements>", '<ssd:SignalDictionaryReference name="bus" dictionary="d"/></ssd:Elements>')],
            {},
            ["'bus' is a signal dictionary"],
        ),
        (
            [('source="resources/mass.fmu" impl', 'type="application/x-ssp-package" source="resources/mass.fmu" impl')],
            {},
            ["the system of component 'second'", "there is no SystemStructure.ssd in it"],
        ),
        ([('implementation="CoSimulation"', 'implementation="ModelExchange"')], {}, ["'second'", "model exchange"]),
        (
            [("</ssd:Connections>", f"{_OUTSIDE}</ssd:Connections>")],
            {},
            ["the system has no connector 'u'"],
        ),
        (
            [('endElement="second"', 'endElement="secnd"')],
            {},
            ["names the component 'secnd'", "did you mean 'second'?"],
        ),
        (
            [('endConnector="x_in"', 'endConnector="x_inn"')],
            {},
            ["'second' has no connector 'x_inn'", "did you mean 'x_in'?"],
        ),
        (
            [('name="x_in" kind="input"', 'name="x_in" kind="parameter"')],
            {},
            ["'second.x_in' is of the kind parameter"],
        ),
        (
            [('name="x_in" kind="input"', 'name="x_in" kind="output"')],
            {},
            ["'second.x_in' is of the kind output", "the FMU resources/mass.fmu has no output of that name"],
        ),
        (
            [('startConnector="v_in"', 'startConnector="F"')],
            {},
            ["second.F to first.v does not go from an output to an input"],
        ),
        (
            [('endElement="second" endConnector="x_in"', 'endElement="second" endConnector="v_in"')],
            {},
            ["second.v_in has more than one source"],
        ),
        (
            [
                (
                    'endConnector="x_in"/>',
                    _MAPPED,
                )
            ],
            {},
            ["second.x_in has a IntegerMappingTransformation", "only linear"],
        ),
        (
            [('prefix="second."/>', 'prefix="second."><ssd:ParameterMapping source="x.ssm"/></ssd:ParameterBinding>')],
            {},
            ["parameter mapping of the system, x.ssm", "not in the package"],
        ),
        ([('prefix="second."', 'prefix="second." type="text/csv"')], {}, ["of the type text/csv"]),
        (
            [('prefix="second."', 'prefix="second." sourceBase="component"')],
            {},
            ["the parameter set of the system is declared to be inside an FMU"],
        ),
        ([(' source="resources/damping.ssv"', "")], {}, ["needs either a source or its own ParameterSet"]),
        ([("resources/damping.ssv", "resources/dampng.ssv")], {}, ["resources/dampng.ssv", "not in the package"]),
        ([("resources/damping.ssv", "../damping.ssv")], {}, ["../damping.ssv, outside of the package"]),
        ([("resources/damping.ssv", "https://example.org/damping.ssv")], {}, ["outside of the package"]),
        (
            [("resources/mass.fmu", "resources/muss.fmu")],
            {},
            ["the FMU of component 'first', resources/muss.fmu", "not in the package"],
        ),
        ([], {"resources__damping_dot_ssv": "<ssv"}, ["resources/damping.ssv: it is not well-formed XML"]),
        (
            [],
            {"resources__damping_dot_ssv": _ssv(c=1).replace("ssv:Real value", "ssv:Reel value")},
            ["resources/damping.ssv, line 1", "does not follow the schema of SSP 1.0", "Reel"],
        ),
        (
            [],
            {"resources__damping_dot_ssv": _ssv(c=1).replace('ssv:Real value="1"', 'ssv:Binary value="00"')},
            ["'c' is of the type Binary"],
        ),
        (
            [],
            {"resources__damping_dot_ssv": _ssv(c=1).replace('ssv:Real value="1"', 'ssv:Enumeration value="thick"')},
            ["'first.c' has no item 'thick'", "it is not an enumeration"],
        ),
        (
            [],
            {"resources__damping_dot_ssv": _ssv(c=1).replace('ssv:Real value="1"', 'ssv:String value="thick"')},
            ["'c' of type Real cannot be 'thick'"],
        ),
        ([], {"resources__damping_dot_ssv": _ssv(F=1)}, ["'F'", "takes a start value"]),
        ([], {"SystemStructure_dot_ssd": "no XML"}, ["SystemStructure.ssd: it is not well-formed XML"]),
        (
            [('version="1.0" name="two masses"', 'version="3.0" name="two masses"')],
            {},
            ["SystemStructure.ssd: it is of SSP 3.0", "export it by SSP 1.0 or 2.0"],
        ),
        (
            [("<ssd:Connections>", "<ssd:Conections>"), ("</ssd:Connections>", "</ssd:Conections>")],
            {},
            ["does not follow the schema of SSP 1.0", "Conections"],
        ),
        ([('startTime="0"', 'startTime="1"')], {}, ["starts at 1 s", "only runs that start at 0"]),
        ([('stopTime="2"', 'stopTime="-2"')], {}, ["stops at -2 s"]),
        (
            [('name="second" source', 'name="fi rst" source'), ('name="first" source', 'name="fi_rst" source')],
            {},
            ["'fi_rst' and 'fi rst' have too similar names"],
        ),
    ],
)
def test_what_is_not_supported_is_refused_in_one_message(
    changes: list[tuple[str, str]], files: dict[str, str], words: list[str], masses: Path, cosim: Cosim, tmp_path: Path
) -> None:
    package = _changed(masses, tmp_path / "wrong.ssp", *changes, **files)
    for command in ("show", "run"):
        ended = cosim(command, package, *(("--output", tmp_path / "out") if command == "run" else ()))
        assert ended.code == 2, ended
        assert ended.err.startswith(f"error: {package}: ")
        assert ended.err.count("\n") == 1
        for word in words:
            assert word in ended.err
    assert not any((tmp_path / "out").glob("*"))


@needs_compiler
def test_a_value_that_nobody_has_is_told(masses: Path, cosim: Cosim, tmp_path: Path) -> None:
    sets = {"resources__damping_dot_ssv": _ssv(c=0.2, friction=3)}
    ended = cosim("show", _changed(masses, tmp_path / "more.ssp", **sets))
    assert ended.code == 0
    assert "note: component 'first' has no variable 'friction'; its parameter value is not used" in ended.err


def test_files_that_are_no_packages(cosim: Cosim, tmp_path: Path) -> None:
    missing = cosim("run", tmp_path / "missing.ssp")
    assert (missing.code, missing.err) == (2, f"error: {tmp_path / 'missing.ssp'}: no such file\n")
    long = cosim("run", tmp_path / f"{'x' * 300}.ssp")
    assert long.code == 2
    assert "cannot be read (File name too long)" in long.err
    (tmp_path / "text.ssp").write_text("this is no archive")
    text = cosim("show", tmp_path / "text.ssp")
    assert text.code == 2
    assert "cannot be unpacked as a system package" in text.err
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w") as archive:
        archive.writestr("readme.txt", "")
    empty = cosim("show", tmp_path / "empty.ssp")
    assert empty.code == 2
    assert "no SystemStructure.ssd" in empty.err
    (tmp_path / "damaged.ssp").write_bytes((tmp_path / "empty.ssp").read_bytes()[:-30])
    assert cosim("show", tmp_path / "damaged.ssp").code == 2


# --- fields and units of measure, in packages that are read and not run -----------------------------------------------


def _declared(variables: str, units: str = "") -> bytes:
    text = (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="m" guid="g">'
        f'<CoSimulation modelIdentifier="m"/>{units}<ModelVariables>{variables}</ModelVariables>'
        "<ModelStructure/></fmiModelDescription>"
    )
    return text.encode()


def _scalar(name: str, reference: int, causality: str, real: str = "") -> str:
    attributes = f'name="{name}" valueReference="{reference}" causality="{causality}"'
    return f"<ScalarVariable {attributes}><Real {real}/></ScalarVariable>"


_UNITS = (
    '<UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit><Unit name="m"><BaseUnit m="1"/></Unit>'
    '<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>'
    '<Unit name="K"><BaseUnit K="1"/></Unit></UnitDefinitions>'
)


def _paper(path: Path, source: str, target: str, connections: str, connectors: tuple[str, str]) -> Path:
    """A package of two FMUs that exist on paper only."""
    parts = "".join(
        f'<ssd:Component name="{name}" source="{name}.fmu"><ssd:Connectors>{text}</ssd:Connectors></ssd:Component>'
        for name, text in zip("ab", connectors, strict=True)
    )
    head, tail = _SSD.split('  <ssd:System name="system">')[0], "</ssd:SystemStructureDescription>"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "SystemStructure.ssd",
            f'{head}<ssd:System name="s"><ssd:Elements>{parts}</ssd:Elements><ssd:Connections>{connections}'
            f'</ssd:Connections></ssd:System><ssd:DefaultExperiment stopTime="1"/>{tail}',
        )
        for name, text in (("a", source), ("b", target)):
            fmu = path.with_name(f"{name}.fmu")
            with zipfile.ZipFile(fmu, "w") as inner:
                inner.writestr("modelDescription.xml", _declared(text, _UNITS))
            archive.write(fmu, f"{name}.fmu")
    return path


def _connect(output: str, target: str, rest: str = "/>") -> str:
    return f'<ssd:Connection startElement="a" startConnector="{output}" endElement="b" endConnector="{target}"{rest}'


def _of_units(path: Path, source: str, target: str, rest: str = "/>", relative: str = "") -> Path:
    return _paper(
        path,
        _scalar("y", 0, "output", f'unit="{source}" {relative}'),
        _scalar("u", 0, "input", f'unit="{target}" start="0"'),
        _connect("y", "u", rest),
        ('<ssd:Connector name="y" kind="output"/>', '<ssd:Connector name="u" kind="input"/>'),
    )


@pytest.mark.parametrize(
    ("source", "target", "rest", "connection"),
    [
        ("mm", "mm", "/>", "a.y -> b.u"),
        ("mm", "m", "/>", "a.y * 0.001 + 0.0 -> b.u"),
        ("degC", "K", "/>", "a.y * 1.0 + 273.15 -> b.u"),
        ("K", "degC", "/>", "a.y * 1.0 + -273.15 -> b.u"),
        ("mm", "m", ' suppressUnitConversion="true"/>', "a.y * 1.0 + 0.0 -> b.u"),
        (
            "mm",
            "m",
            '><ssc:LinearTransformation factor="2" offset="1"/></ssd:Connection>',
            "a.y * 0.002 + 1.0 -> b.u",
        ),
        (
            "mm",
            "m",
            ' suppressUnitConversion="true"><ssc:LinearTransformation factor="2"/></ssd:Connection>',
            "a.y * 2.0 + 0.0 -> b.u",
        ),
    ],
)
def test_units_of_measure_are_converted(source: str, target: str, rest: str, connection: str, tmp_path: Path) -> None:
    with open_package(_of_units(tmp_path / "units.ssp", source, target, rest)) as (scenario, _):
        assert scenario.connections == [connection]


def test_differences_of_temperature_have_no_offset(tmp_path: Path) -> None:
    path = _of_units(tmp_path / "units.ssp", "degC", "K", relative='relativeQuantity="true"')
    with open_package(path) as (scenario, _):
        assert scenario.connections == ["a.y * 1.0 + 0.0 -> b.u"]


@pytest.mark.parametrize(
    ("source", "target", "words"),
    [("mm", "K", "mm and K measure different things"), ("mm", "furlong", "'furlong' is not defined")],
)
def test_units_that_cannot_be_converted_are_refused(source: str, target: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=words), open_package(_of_units(tmp_path / "units.ssp", source, target)):
        pass


def test_a_connector_in_another_unit_than_its_variable_is_refused(tmp_path: Path) -> None:
    path = _of_units(tmp_path / "units.ssp", "mm", "m")
    connector = '<ssd:Connector name="y" kind="output"{}>'
    shown = (connector.format("/"), connector.format("") + '<ssc:Real unit="m"/></ssd:Connector>')
    with (
        pytest.raises(InputError, match=r"'a\.y' is in m, but the FMU a\.fmu says mm"),
        open_package(_changed(path, tmp_path / "wrong.ssp", shown)),
    ):
        pass


def test_parameter_values_are_converted(tmp_path: Path) -> None:
    path = _of_units(tmp_path / "units.ssp", "mm", "m")
    values = (
        '<ssd:ParameterBindings><ssd:ParameterBinding prefix="b."><ssd:ParameterValues>'
        '<ssv:ParameterSet version="1.0" name="p"><ssv:Parameters><ssv:Parameter name="u">'
        '<ssv:Real value="12" unit="mm"/></ssv:Parameter></ssv:Parameters><ssv:Units><ssc:Unit name="mm">'
        '<ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit></ssv:Units></ssv:ParameterSet>'
        "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    given = _changed(path, tmp_path / "given.ssp", ('<ssd:System name="s">', f'<ssd:System name="s">{values}'))
    with open_package(given) as (scenario, _):
        assert scenario.units["b"].start == {"u": 0.012}


@pytest.mark.parametrize(
    ("pairs", "connections"),
    [
        ([(1, 1), (2, 2), (3, 3)], ["a.y -> b.u"]),
        ([(3, 3), (1, 1), (2, 2)], ["a.y -> b.u"]),
        ([(1, 1), (2, 2)], ["a.y[1] -> b.u[1]", "a.y[2] -> b.u[2]"]),
        ([(1, 2), (2, 1), (3, 3)], ["a.y[1] -> b.u[2]", "a.y[2] -> b.u[1]", "a.y[3] -> b.u[3]"]),
    ],
)
def test_fields_are_connected_as_a_whole_or_by_their_elements(
    pairs: list[tuple[int, int]], connections: list[str], tmp_path: Path
) -> None:
    package = _paper(
        tmp_path / "fields.ssp",
        "".join(_scalar(f"y[{k}]", k, "output") for k in (1, 2, 3)),
        "".join(_scalar(f"u[{k}]", k, "input", 'start="0"') for k in (1, 2, 3)),
        "".join(_connect(f"y[{k}]", f"u[{i}]") for k, i in pairs),
        (
            "".join(f'<ssd:Connector name="y[{k}]" kind="output"/>' for k in (1, 2, 3)),
            "".join(f'<ssd:Connector name="u[{k}]" kind="input"/>' for k in (1, 2, 3)),
        ),
    )
    with open_package(package) as (scenario, _):
        assert scenario.connections == connections


def test_names_with_blanks_and_arrows_are_connected_as_they_are(tmp_path: Path) -> None:
    package = _paper(
        tmp_path / "names.ssp",
        _scalar("y out * 2 -&gt; z", 0, "output"),
        _scalar("u in", 1, "input", 'start="0"'),
        _connect("y out * 2 -&gt; z", "u in"),
        ('<ssd:Connector name="y out * 2 -&gt; z" kind="output"/>', '<ssd:Connector name="u in" kind="input"/>'),
    )
    with open_package(package) as (scenario, _):
        (connection,) = scenario.resolved()["connections"]
    wanted = {"from": "a", "output": "y out * 2 -> z", "to": "b", "input": "u in"}
    assert {key: value for key, value in connection.items() if value is not None} == wanted


def test_an_annotation_that_is_not_ours_any_more_is_refused(cosim: Cosim, tmp_path: Path) -> None:
    package = _package(cosim, _SCENARIOS / "cell.yaml", tmp_path / "built", "run.stop_ms=30")
    with zipfile.ZipFile(package) as archive:
        (kept,) = re.findall(r">(\{.*\})<", archive.read("SystemStructure.ssd").decode())
    assert json.loads(kept)["coupling"]["step_ms"] == 1.0
    for wrong in ("{", "[]", "{}"):
        damaged = _changed(package, tmp_path / "damaged.ssp", (kept, wrong))
        ended = cosim("show", damaged)
        assert ended.code == 2
        assert "the annotation cardiac-cosim.scenario cannot be read" in ended.err
