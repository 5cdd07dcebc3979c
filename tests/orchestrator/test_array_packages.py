"""If these fail, packages of SSP 2.0 run with other values, types or shapes than they have, or end in a traceback."""

import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import build_box
import pytest
from cardiac_cosim.orchestrator import ssp
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.scenario import Scenario
from cardiac_cosim.orchestrator.ssp import open_package
from lxml import etree
from written import rows

Cosim = Callable[..., Any]

_SCHEMAS = Path(ssp.__file__).parent / "schemas"

_SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{long}"'
    for short, long in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"))
)

_UNITS = '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'


def _variable(kind: str, name: str, reference: int, rest: str, sizes: str = "", inner: str = "") -> str:
    dimensions = "".join(
        f'<Dimension {"start" if size.isdigit() else "valueReference"}="{size.strip("@")}"/>' for size in sizes.split()
    )
    return f'<{kind} name="{name}" valueReference="{reference}" {rest}>{dimensions}{inner}</{kind}>'


def _pair(kind: str, names: str, reference: int, start: str, sizes: str = "", causality: str = "parameter") -> str:
    """A parameter (or input) and the output that the box makes of it: one more, the contrary, in brackets."""
    given, made = names.split()
    fixed = 'variability="fixed"' if causality == "parameter" else 'variability="discrete"'
    if kind == "Float64" and causality == "input":
        fixed = 'variability="continuous"'
    text = f'<Start value="{start}"/>' if kind == "String" else ""
    begin = "" if text else f'start="{start}"'
    rest = 'variability="continuous"' if kind == "Float64" else 'variability="discrete"'
    return _variable(kind, given, reference, f'causality="{causality}" {fixed} {begin}', sizes, text) + _variable(
        kind, made, reference + 1, f'causality="output" {rest}', sizes
    )


#: Reference 30 of UInt64 is the structural parameter that sizes u and y.
_VARIABLES = (
    _variable("UInt64", "n", 130, 'causality="structuralParameter" variability="fixed" start="3"')
    + _pair("Float64", "u y", 0, "0 0 0", "@130", "input")
    + _pair("Float64", "gain gained", 2, "1", "2 2")
    + _pair("Float64", "length longer", 4, "1")
    + _pair("Float32", "short shorter", 0, "1")
    + "".join(
        _pair(f"{sign}Int{bits}", f"{sign}i{bits} {sign}o{bits}".lower(), 0, "1")
        for sign in ("", "U")
        for bits in (8, 16, 32, 64)
    )
    + _pair("Boolean", "on off", 0, "false")
    + _pair("Boolean", "switches contraries", 2, "false", "2")
    + _pair("String", "word said", 0, "x")
)


@pytest.fixture
def box(tmp_path: Path) -> Path:
    """An FMU of FMI 3.0 in C, with arrays; in it every output is one more than what stands before it."""
    if build_box.compiler() is None:
        pytest.skip("no C compiler to build foreign FMUs with")
    return build_box.build_box3(tmp_path / "box.fmu", _VARIABLES)


def _connector(name: str, kind: str, inner: str = "") -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}">{inner}</ssd:Connector>'


_SIZED = '<ssc:Float64/><ssc:Dimension sizeConnector="n"/>'
_CONNECTORS = (
    _connector("n", "structuralParameter") + _connector("u", "input", _SIZED) + _connector("y", "output", _SIZED)
)


def _component(name: str, parameters: str = "", connectors: str = _CONNECTORS, source: str = "box.fmu") -> str:
    given = (
        f"<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{_set(parameters)}</ssd:ParameterValues>"
        "</ssd:ParameterBinding></ssd:ParameterBindings>"
        if parameters
        else ""
    )
    return (
        f'<ssd:Component name="{name}" source="{source}"><ssd:Connectors>{connectors}</ssd:Connectors>{given}'
        "</ssd:Component>"
    )


def _set(parameters: str, version: str = "2.0") -> str:
    return (
        f'<ssv:ParameterSet version="{version}" name="p" {_SPACES}><ssv:Parameters>{parameters}</ssv:Parameters>'
        f"<ssv:Units>{_UNITS}</ssv:Units></ssv:ParameterSet>"
    )


def _given(name: str, kind: str, value: str, *sizes: int, inner: str = "") -> str:
    dimensions = "".join(f'<ssc:Dimension size="{size}"/>' for size in sizes)
    attribute = f' value="{value}"' if value else ""
    return f'<ssv:Parameter name="{name}"><ssv:{kind}{attribute}>{inner}</ssv:{kind}>{dimensions}</ssv:Parameter>'


_LINKS = (
    '<ssd:Connection startElement="a" startConnector="y" endElement="b" endConnector="u"/>'
    '<ssd:Connection startElement="b" startConnector="y" endElement="a" endConnector="u"/>'
)


def _package(folder: Path, box: Path, elements: str, links: str = _LINKS, version: str = "2.0") -> Path:
    path = folder / "arrays.ssp"
    wires = f"<ssd:Connections>{links}</ssd:Connections>" if links else ""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "SystemStructure.ssd",
            f'<ssd:SystemStructureDescription version="{version}" name="arrays" {_SPACES}><ssd:System name="s">'
            f'<ssd:Elements>{elements}</ssd:Elements>{wires}</ssd:System><ssd:DefaultExperiment stopTime="3"/>'
            "</ssd:SystemStructureDescription>",
        )
        archive.write(box, "box.fmu")
    return path


@contextmanager
def _opened(path: Path) -> Iterator[Scenario]:
    told: list[str] = []
    with open_package(path, (), told.append) as (scenario, _):
        yield scenario
    assert told == []


def _integers(value: int) -> str:
    return "".join(
        _given(f"{sign}i{bits}".lower(), f"{sign}Int{bits}", str(value))
        for sign in ("", "U")
        for bits in (8, 16, 32, 64)
    )


_ALL = (
    _given("gain", "Float64", "1 2.5 -3 1e-3", 2, 2)
    + _given("length", "Float64", "7")
    + _given("short", "Float32", "0.5")
    + _integers(40)
    + _given("on", "Boolean", "1")
    + _given("switches", "Boolean", "true false", 2)
    + _given("word", "String", "", inner='<ssv:Value value="ab c"/>')
    + _given("u", "Float64", "10 20 30", 3)
    + _given("n", "UInt64", "3")
)


def test_every_type_and_array_arrives(box: Path, cosim: Cosim, tmp_path: Path) -> None:
    path = _package(tmp_path, box, _component("a", _ALL) + _component("b"), _LINKS.partition("/>")[0] + "/>")
    with _opened(path) as scenario:
        assert scenario.connections == ["a.y -> b.u"]
        assert scenario.units["a"].parameters["gain"] == [1.0, 2.5, -3.0, 1e-3]
        assert scenario.units["a"].start == {"u": [10.0, 20.0, 30.0]}
        assert "n" not in scenario.units["a"].parameters
    sets = ("--set", "coupling.step_ms=1000", "--set", "output.every_ms=1000", "--set", "coupling.scheme=gauss-seidel")
    ended = cosim("run", path, "--output", tmp_path / "out", *sets)
    assert ended.code == 0, ended.err
    last = rows(tmp_path / "out")[-1]
    made = {name.removeprefix("a."): value for name, value in last.items() if name.startswith("a.")}
    assert [float(made[f"y[{place}]"]) for place in (1, 2, 3)] == [11.0, 21.0, 31.0]
    assert [float(made[f"gained[{place}]"]) for place in ("1,1", "1,2", "2,1", "2,2")] == [2.0, 3.5, -2.0, 1.001]
    assert (made["longer"], made["shorter"], made["off"], made["said"]) == ("8.0", "1.5", "0", "<ab c>")
    assert [made[f"contraries[{place}]"] for place in (1, 2)] == ["0", "1"]
    assert {made[f"{sign}o{bits}"] for sign in ("", "u") for bits in (8, 16, 32, 64)} == {"41"}
    assert [float(last[f"b.y[{place}]"]) for place in (1, 2, 3)] == [12.0, 22.0, 32.0]
    # Written again, it says the same in the letter of the standard.
    again = tmp_path / "again" / "arrays.ssp"
    assert cosim("build", path, "--ssp", "--output", again.parent, *sets).code == 0
    with zipfile.ZipFile(again) as archive:
        for name, schema in (("SystemStructure.ssd", "Description"), ("resources/a.ssv", "ParameterValues")):
            root = etree.fromstring(archive.read(name))
            assert root.get("version") == "2.0"
            etree.XMLSchema(file=str(_SCHEMAS / f"SystemStructure{schema}.xsd")).assertValid(root)
    with _opened(path) as before, _opened(again) as after:
        assert before.connections == after.connections
        assert {name: entry.parameters for name, entry in before.units.items()} == {
            name: entry.parameters for name, entry in after.units.items()
        }
        assert before.units["a"].start == after.units["a"].start


def test_values_in_other_units_of_measure_are_converted(box: Path, tmp_path: Path) -> None:
    variables = _VARIABLES.replace('name="length"', 'name="length" unit="m"').replace(
        'name="gain"', 'name="gain" unit="m"'
    )
    with zipfile.ZipFile(box) as old, zipfile.ZipFile(tmp_path / "measured.fmu", "w") as new:
        for name in old.namelist():
            content = old.read(name).decode("latin-1").replace(_VARIABLES, variables)
            units = '<UnitDefinitions><Unit name="m"><BaseUnit m="1"/></Unit></UnitDefinitions><ModelVariables>'
            new.writestr(name, content.replace("<ModelVariables>", units).encode("latin-1"))
    given = _given("length", "Float64", "2000") + _given("gain", "Real", "1000 2000 3000 4000", 2, 2)
    given = given.replace("<ssv:Float64 ", '<ssv:Float64 unit="mm" ').replace("<ssv:Real ", '<ssv:Real unit="mm" ')
    with _opened(_package(tmp_path, tmp_path / "measured.fmu", _component("a", given), "")) as scenario:
        assert scenario.units["a"].parameters == {"length": 2.0, "gain": [1.0, 2.0, 3.0, 4.0]}


def _system(inner: str, sizes: str = "") -> str:
    """A system around the component `c`, which an array passes through on its way in and out."""
    pins = _connector("v", "input", sizes) + _connector("w", "output", sizes)
    links = (
        '<ssd:Connection startConnector="v" endElement="c" endConnector="u"/>'
        '<ssd:Connection startElement="c" startConnector="y" endConnector="w"/>'
    )
    return (
        f'<ssd:System name="B"><ssd:Connectors>{pins}</ssd:Connectors><ssd:Elements>{inner}</ssd:Elements>'
        f"<ssd:Connections>{links}</ssd:Connections></ssd:System>"
    )


_THROUGH = (
    '<ssd:Connection startElement="a" startConnector="y" endElement="B" endConnector="v"/>'
    '<ssd:Connection startElement="B" startConnector="w" endElement="a" endConnector="u"/>'
)


@pytest.mark.parametrize("sizes", ["", '<ssc:Dimension size="3"/>', "<ssc:Dimension/>", _SIZED])
def test_an_array_goes_through_systems(sizes: str, box: Path, tmp_path: Path) -> None:
    path = _package(tmp_path, box, _component("a") + _system(_component("c"), sizes), _THROUGH)
    with _opened(path) as scenario:
        assert sorted(scenario.connections) == ["B_c.y -> a.u", "a.y -> B_c.u"]


def test_fmus_of_both_versions_are_in_one_package(box: Path, cosim: Cosim, tmp_path: Path) -> None:
    other = build_box.build_box(tmp_path / "two.fmu", [("y", "Real", "output", 1), ("u", "Real", "input", 0)])
    connectors = _connector("u", "input", "<ssc:Real/>") + _connector("y", "output", "<ssc:Real/>")
    parts = _component("a", connectors=_connector("longer", "output", "<ssc:Float64/>"))
    path = _package(
        tmp_path,
        box,
        parts + _component("b", connectors=connectors, source="two.fmu"),
        '<ssd:Connection startElement="a" startConnector="longer" endElement="b" endConnector="u"/>',
    )
    with zipfile.ZipFile(path, "a") as archive:
        archive.write(other, "two.fmu")
    ended = cosim("run", path, "--output", tmp_path / "out", "--set", "coupling.step_ms=1000")
    assert ended.code == 0, ended.err
    again = cosim("build", path, "--ssp", "--output", tmp_path / "again")
    assert again.code == 0, again.err
    with _opened(tmp_path / "again" / "arrays.ssp") as scenario:
        assert scenario.connections == ["a.longer -> b.u"]
    for option in ("--osp", "--container"):
        refused = cosim("build", path, option, "--output", tmp_path / "other")
        assert refused.code == 2
        assert "of 'a' is of FMI 3.0, which cannot be written for" in refused.err


def test_an_array_of_fmi_3_has_no_elements_in_a_package(box: Path, cosim: Cosim, tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(
        "name: part\nunits:\n  a: {fmu: box.fmu}\n  b: {fmu: box.fmu}\nconnections: ['a.longer -> b.u[2]']\n"
        "connect_by_name: false\nrun: {stop_ms: 1}\ncoupling: {step_ms: 1}\noutput: {every_ms: 1}\n"
    )
    ended = cosim("build", tmp_path / "part.yaml", "--ssp", "--output", tmp_path / "out")
    assert ended.code == 2
    assert "single elements of the array b.u of FMI 3.0 are connected" in ended.err
    assert "connect whole arrays" in ended.err


_ONE = _component("a")
_OTHER_SIZE = _CONNECTORS.replace('sizeConnector="n"', 'size="4"', 1)
_TWICE = _CONNECTORS.replace('sizeConnector="n"', 'size="3" sizeConnector="n"', 1)
_TO_SQUARE = '<ssd:Connection startElement="a" startConnector="gained" endElement="b" endConnector="u"/>'


@pytest.mark.parametrize(
    ("elements", "links", "words"),
    [
        (
            _component("a", connectors=_OTHER_SIZE) + _component("b"),
            _LINKS,
            "connector 'a.u' is an array of 4, but in the FMU box.fmu it is an array of 3",
        ),
        (
            _component("a", connectors=_CONNECTORS.replace("Float64", "Boolean")) + _component("b"),
            _LINKS,
            "connector 'a.y' is of the type Boolean, but the FMU box.fmu says Float64",
        ),
        (_component("a", connectors=_TWICE) + _component("b"), _LINKS, "a size and a sizeConnector; keep one"),
        (
            _component("a", connectors=_connector("gained", "output")) + _component("b"),
            _TO_SQUARE,
            "the connection of a.gained to b.u: the shapes differ, an array of 2 × 2 -> an array of 3; connect",
        ),
        (
            _component("a", connectors=_connector("longer", "output")) + _component("b"),
            _TO_SQUARE.replace("gained", "longer"),
            "the shapes differ, a scalar -> an array of 3",
        ),
        (
            _ONE + _component("b"),
            _LINKS.replace('startConnector="y"', 'startConnector="y" startIndices="1"', 1),
            "has startIndices, and the standard does not say",
        ),
        (
            _ONE + _system(_component("c"), '<ssc:Dimension size="7"/>'),
            _THROUGH,
            "the connector B.w on the way is an array of 7, but the output an array of 3",
        ),
        (_ONE.replace(' source="box.fmu"', ""), "", "component 'a' has no source"),
        (_ONE.replace("<ssd:Component ", '<ssd:Component implementation="ScheduledExecution" '), "", "by scheduled"),
        (_component("a", _given("n", "UInt64", "4")), "", "'a.n' is a structural parameter, which keeps its start"),
        (_component("a", _given("gain", "Float64", "1 2 3", 2, 2)), "", "has 3 values, but is an array of 2 × 2"),
        (_component("a", _given("gain", "Float64", "1 2")), "", "has 2 values, but is a scalar"),
        (_component("a", _given("gain", "Float64", "1")), "", "'gain' is a scalar, but 'a.gain' is an array of 2 × 2"),
        (_component("a", _given("gain", "Float64", "1 1 1 1", 4)), "", "an array of 4, but 'a.gain' is an array of 2"),
        (_component("a", _given("length", "Float64", "1 2", 2)), "", "an array of 2, but 'a.length' is a scalar"),
        (_component("a", _given("gain", "Float64", "1 2 NaN 4", 2, 2)), "", "'gain' is nan"),
        (_component("a", _given("word", "String", "")), "", "'word' has either no value or two"),
        (_component("a", _given("word", "String", "x", inner='<ssv:Value value="y"/>')), "", "no value or two"),
        (
            _component("a", _given("gain", "Float64", "1", 1).replace('size="1"', "")),
            "",
            "'gain' has a dimension without its own size",
        ),
        (_component("a", _given("ui8", "UInt8", "256")), "", "does not follow the schema of SSP 2.0"),
        (_component("a", _given("ui8", "Int32", "256")), "", "'ui8' of type UInt8 cannot be 256"),
        (_component("a", _given("on", "Int32", "1")), "", "'on' of type Boolean cannot be 1"),
        (_component("a", _given("gain", "Boolean", "0 1 0 1", 2, 2)), "", "'gain' of type Float64 cannot be False"),
        (_component("a", _given("word", "Binary", "00")), "", "is of the type Binary"),
        (_component("a", source="box.fmu#x"), "", "not in the package"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_message(
    elements: str, links: str, words: str, box: Path, cosim: Cosim, tmp_path: Path
) -> None:
    ended = cosim("show", _package(tmp_path, box, elements, links))
    assert ended.code == 2, ended
    assert words in ended.err
    assert ended.err.count("\n") == 1


@pytest.mark.parametrize(
    ("version", "inside", "words"),
    [
        ("3.0", "2.0", "SystemStructure.ssd: it is of SSP 3.0, which is not supported"),
        ("2.1", "2.0", "SystemStructure.ssd: it is of SSP 2.1, which is not supported"),
        ("1.0", "2.0", "does not follow the schema of SSP 1.0"),
        ("2.0", "2.7", "the parameter set of component 'a': it is of SSP 2.7, which is not supported"),
        ("2.0", "1.0", "does not follow the schema of SSP 1.0"),
    ],
)
def test_each_file_is_read_by_its_own_version(version: str, inside: str, words: str, box: Path, tmp_path: Path) -> None:
    given = _component("a", _given("length", "Float64", "1")).replace(
        'ParameterSet version="2.0"', f'ParameterSet version="{inside}"'
    )
    with pytest.raises(InputError) as caught, _opened(_package(tmp_path, box, given, "", version)):
        pass
    assert words in str(caught.value)
