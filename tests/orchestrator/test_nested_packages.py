"""A package of systems in systems could run with other connections, values or units than its author gave it."""

import json
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.scenario import Scenario
from cardiac_cosim.orchestrator.ssp import open_package

_SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{long}"'
    for short, long in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)

_UNITS = (
    '<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit><Unit name="m"><BaseUnit m="1"/></Unit>'
    '<Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit><Unit name="K"><BaseUnit K="1"/></Unit>'
)
_SSC_UNITS = _UNITS.replace("<Unit", "<ssc:Unit").replace("</Unit", "</ssc:Unit").replace("<Base", "<ssc:Base")


def fmu(path: Path, unit: str = "m") -> Path:
    """An FMU that exists on paper only: y follows u, with a gain, a count, a switch, a word and a kind."""
    text = (
        '<fmiModelDescription fmiVersion="2.0" modelName="m" guid="g"><CoSimulation modelIdentifier="m"/>'
        f"<UnitDefinitions>{_UNITS}</UnitDefinitions>"
        '<TypeDefinitions><SimpleType name="kind"><Enumeration><Item name="thin" value="1"/>'
        '<Item name="thick" value="7"/></Enumeration></SimpleType></TypeDefinitions><ModelVariables>'
        f'<ScalarVariable name="y" valueReference="0" causality="output"><Real unit="{unit}"/></ScalarVariable>'
        f'<ScalarVariable name="u" valueReference="1" causality="input"><Real unit="{unit}" start="0"/>'
        "</ScalarVariable>"
    )
    for number, (name, kind) in enumerate(
        (
            ("gain", f'<Real start="1" unit="{unit}"/>'),
            ("count", '<Integer start="1"/>'),
            ("on", '<Boolean start="false"/>'),
            ("word", '<String start=""/>'),
            ("kind", '<Enumeration declaredType="kind" start="1"/>'),
        ),
        start=2,
    ):
        text += (
            f'<ScalarVariable name="{name}" valueReference="{number}" causality="parameter" variability="fixed">{kind}'
            "</ScalarVariable>"
        )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", f"{text}</ModelVariables><ModelStructure/></fmiModelDescription>")
        archive.writestr("resources/own.ssv", values(gain=("Real", 5)))
    return path


def values(**given: tuple[str, object]) -> str:
    """A parameter set."""
    parameters = "".join(
        f'<ssv:Parameter name="{name.replace("__", ".")}"><ssv:{kind} value="{value}"/></ssv:Parameter>'
        for name, (kind, value) in given.items()
    )
    return (
        f'<ssv:ParameterSet version="1.0" name="p" {_SPACES}><ssv:Parameters>{parameters}</ssv:Parameters>'
        "</ssv:ParameterSet>"
    )


def bound(content: str, mapping: str = "", prefix: str = "") -> str:
    """A parameter binding of a set that stands in it, and of a mapping."""
    mapped = (
        f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{mapping}</ssm:ParameterMapping>'
        "</ssd:ParameterMapping>"
        if mapping
        else ""
    )
    return (
        f'<ssd:ParameterBinding prefix="{prefix}"><ssd:ParameterValues>{content}</ssd:ParameterValues>{mapped}'
        "</ssd:ParameterBinding>"
    )


def connectors(**kinds: str) -> str:
    """Connectors: `u="input"`, or with a unit `u="input mm"`."""
    text = ""
    for name, kind in kinds.items():
        kind, _, unit = kind.partition(" ")
        real = f'<ssc:Real unit="{unit}"/>' if unit else ""
        text += f'<ssd:Connector name="{name}" kind="{kind}">{real}</ssd:Connector>'
    return f"<ssd:Connectors>{text}</ssd:Connectors>"


def component(name: str, source: str = "m.fmu", bindings: str = "", kind: str = "", **others: str) -> str:
    given = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    mime = f' type="application/x-{kind}"' if kind else ""
    own = connectors(**({"y": "output", "u": "input", "gain": "parameter"} | others))
    return f'<ssd:Component name="{name}" source="{source}"{mime}>{own}{given}</ssd:Component>'


def system(name: str, elements: str, links: Sequence[str] = (), bindings: str = "", **pins: str) -> str:
    """A system; its connections as `a.y -> b.u`, with anything behind a bar put into the element."""
    text = ""
    for link in links:
        ends, _, inside = link.partition(" | ")
        attributes = ""
        for side, end in zip(("start", "end"), ends.split(" -> "), strict=True):
            element, _, connector = end.rpartition(".")
            attributes += f' {side}Element="{element}"' if element else ""
            attributes += f' {side}Connector="{connector}"'
        more, _, inner = inside.partition(" | ")
        text += f"<ssd:Connection{attributes} {more}>{inner}</ssd:Connection>"
    given = f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else ""
    inner = f"<ssd:Elements>{elements}</ssd:Elements>" if elements else ""
    wires = f"<ssd:Connections>{text}</ssd:Connections>" if links else ""
    return f'<ssd:System name="{name}">{connectors(**pins) if pins else ""}{given}{inner}{wires}</ssd:System>'


def described(content: str, rest: str = "") -> str:
    """A system structure description."""
    return (
        f'<ssd:SystemStructureDescription version="1.0" name="nested" {_SPACES}>{content}'
        f'<ssd:Units>{_SSC_UNITS}</ssd:Units><ssd:DefaultExperiment stopTime="1"/>{rest}'
        "</ssd:SystemStructureDescription>"
    )


def package(folder: Path, content: str, rest: str = "", **files: str | bytes) -> Path:
    """A package; `files` by names with `__` for a slash, and without an ending `_ssv` for `.ssv`."""
    path = folder / "nested.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", described(content, rest))
        for name, unit in (("m", "m"), ("mm", "mm"), ("t", "K")):
            archive.write(fmu(folder / f"{name}.fmu", unit), f"{name}.fmu")
        for name, text in files.items():
            archive.writestr(name.replace("__", "/").replace("_dot_", "."), text)
    return path


@contextmanager
def opened(path: Path, told: list[str] | None = None) -> Iterator[Scenario]:
    with open_package(path, (), (lambda _: None) if told is None else told.append) as (scenario, folder):
        for entry in scenario.units.values():
            assert (folder / str(entry.fmu)).is_file()
        yield scenario


_INNER = system("B", component("c") + component("d"), ["u -> c.u", "c.y -> d.u", "d.y -> y"], u="input", y="output")


def test_connections_go_through_systems(tmp_path: Path) -> None:
    """A component in a system could be fed by nobody, or by the wrong one."""
    whole = system("A", component("a") + _INNER + component("z"), ["B.u -> a.y", "B.y -> z.u"])
    with opened(package(tmp_path, whole)) as scenario:
        assert list(scenario.units) == ["a", "B_c", "B_d", "z"]
        assert sorted(scenario.connections) == ["B_c.y -> B_d.u", "B_d.y -> z.u", "a.y -> B_c.u"]


def test_connections_go_through_systems_at_any_depth(tmp_path: Path) -> None:
    """Ten systems around a component could lose its connection, or one that only passes through."""
    inner = component("c")
    names = ""
    for level in range(10):
        inside = "c" if level == 0 else f"s{level - 1}"
        inner = system(f"s{level}", inner, [f"u -> {inside}.u", f"y -> {inside}.y"], u="input", y="output")
        names = f"s{level}_{names}"
    through = system("p", "", ["u -> y"], u="input", y="output")
    whole = system("A", component("a") + inner + through, ["a.y -> s9.u", "s9.y -> p.u", "p.y -> a.u"])
    with opened(package(tmp_path, whole)) as scenario:
        assert sorted(scenario.connections) == sorted([f"a.y -> {names}c.u", f"{names}c.y -> a.u"])


@pytest.mark.parametrize(
    ("links", "pins", "connection"),
    [
        (["a.y -> B.u", "u -> c.u"], ("mm", "m", ""), "a.y * 0.001 + 0.0 -> B_c.u"),
        (["a.y -> B.u", "u -> c.u"], ("mm", "m", "mm"), "a.y * 0.001 + 0.0 -> B_c.u"),
        # Twice and one more, in mm, where the connector of the system says so.
        (
            ['a.y -> B.u |  | <ssc:LinearTransformation factor="2" offset="1"/>', "u -> c.u"],
            ("m", "m", "mm"),
            "a.y * 2.0 + 0.001 -> B_c.u",
        ),
        # And of a mm that nobody has said, in m.
        (
            ['a.y -> B.u |  | <ssc:LinearTransformation factor="2" offset="1"/>', "u -> c.u"],
            ("m", "m", ""),
            "a.y * 2.0 + 1.0 -> B_c.u",
        ),
        (
            [
                'a.y -> B.u |  | <ssc:LinearTransformation factor="2" offset="1"/>',
                'u -> c.u |  | <ssc:LinearTransformation factor="3" offset="5"/>',
            ],
            ("m", "m", "m"),
            "a.y * 6.0 + 8.0 -> B_c.u",
        ),
        (['a.y -> B.u | suppressUnitConversion="true"', "u -> c.u"], ("mm", "m", "m"), "a.y * 1.0 + 0.0 -> B_c.u"),
        (["a.y -> B.u", "u -> c.u"], ("t", "t", "degC"), "a.y * 1.0 + 0.0 -> B_c.u"),
    ],
)
def test_laws_and_units_are_put_together(
    links: list[str], pins: tuple[str, str, str], connection: str, tmp_path: Path
) -> None:
    """A value that crosses a system could be a thousand times too large."""
    source, target, unit = pins
    inner = system("B", component("c", f"{target}.fmu"), [links[1]], u=f"input {unit}")
    whole = system("A", component("a", f"{source}.fmu") + inner, [links[0]])
    with opened(package(tmp_path, whole)) as scenario:
        assert scenario.connections == [connection]


def test_inputs_that_nobody_feeds_take_the_value_of_the_connector(tmp_path: Path) -> None:
    """A package's value for its own input could be lost, or be taken in the wrong unit."""
    inner = system("B", component("c"), ["u -> c.u", "k -> c.gain"], u="input mm", k="parameter")
    given = bound(values(u=("Real", 250), B__k=("Real", 3), y=("Real", 1), idle=("Real", 2)))
    whole = system("A", inner, ["u -> B.u", "B.u -> idle"][:1], given, u="input mm", y="output", idle="input")
    told: list[str] = []
    with opened(package(tmp_path, whole), told) as scenario:
        assert scenario.connections == []
        assert scenario.units["B_c"].start == {"u": 0.25}
        assert scenario.units["B_c"].parameters == {"gain": 3.0}
    assert len(told) == 2
    assert all("passes its parameter value to no component" in text for text in told)


def test_inputs_without_a_value_keep_their_start_values(tmp_path: Path) -> None:
    """A package with inputs from outside could be refused."""
    whole = system("A", _INNER, ["u -> B.u", "B.y -> y"], u="input", y="output")
    with opened(package(tmp_path, whole)) as scenario:
        assert scenario.connections == ["B_c.y -> B_d.u"]
        assert scenario.units["B_c"].start == {}


def test_outer_values_go_before_inner_ones_and_later_before_earlier(tmp_path: Path) -> None:
    """A component could run with the value that its author had replaced."""

    def levels(*kept: str) -> str:
        own = {
            "component": bound(values(gain=("Real", 1))),
            "inner": bound(values(c__gain=("Real", 2))),
            "inner later": bound(values(gain=("Real", 3)), prefix="c."),
            "outer": bound(values(B__c__gain=("Real", 4))),
            "outer later": bound(values(c__gain=("Real", 5)), prefix="B."),
        }
        some = {name: text if name in kept else "" for name, text in own.items()}
        inner = system("B", component("c", bindings=some["component"]), [], some["inner"] + some["inner later"])
        return system("A", inner, [], some["outer"] + some["outer later"])

    names = ("component", "inner", "inner later", "outer", "outer later")
    for number in range(1, 6):
        with opened(package(tmp_path, levels(*names[:number]))) as scenario:
            assert scenario.units["B_c"].parameters == {"gain": float(number)}
    with opened(package(tmp_path, levels("component", "outer"))) as scenario:
        assert scenario.units["B_c"].parameters == {"gain": 4.0}


def test_a_name_that_several_have_is_given_to_all(tmp_path: Path) -> None:
    """Of two variables that the standard gives one name, one could keep its default."""
    whole = system("A", component("B.c") + system("B", component("c")), [], bound(values(B__c__gain=("Real", 4))))
    with opened(package(tmp_path, whole)) as scenario:
        assert [entry.parameters for entry in scenario.units.values()] == [{"gain": 4.0}] * 2
        assert list(scenario.units) == ["B_c", "B_c_2"]


def test_parameters_are_mapped(tmp_path: Path) -> None:
    """A mapped value could go to the wrong variable, untransformed, or under its old name as well."""
    mapping = (
        '<ssm:MappingEntry source="p.g" target="a.gain"><ssc:LinearTransformation factor="2" offset="1"/>'
        "</ssm:MappingEntry>"
        '<ssm:MappingEntry source="p.g" target="a.u"/>'
        '<ssm:MappingEntry source="p.n" target="a.count"><ssc:IntegerMappingTransformation>'
        '<ssc:MapEntry source="3" target="30"/></ssc:IntegerMappingTransformation></ssm:MappingEntry>'
        '<ssm:MappingEntry source="p.b" target="a.on"><ssc:BooleanMappingTransformation>'
        '<ssc:MapEntry source="0" target="true"/></ssc:BooleanMappingTransformation></ssm:MappingEntry>'
        '<ssm:MappingEntry source="p.e" target="a.kind"><ssc:EnumerationMappingTransformation>'
        '<ssc:MapEntry source="fat" target="thick"/></ssc:EnumerationMappingTransformation></ssm:MappingEntry>'
        '<ssm:MappingEntry source="p.w" target="a.word"/>'
        '<ssm:MappingEntry source="p.missing" target="a.on"/>'.replace("a.on", "a.nothing")
    )
    content = values(
        g=("Real", 5), n=("Integer", 3), b=("Boolean", "false"), e=("Enumeration", "fat"), w=("String", "x")
    )
    told: list[str] = []
    whole = system("A", component("a"), [], bound(content, mapping.replace("a.nothing", "a.on", 1), "p."))
    with opened(package(tmp_path, whole), told) as scenario:
        assert scenario.units["a"].parameters == {"gain": 11.0, "count": 30, "on": True, "kind": 7, "word": "x"}
        assert scenario.units["a"].start == {"u": 5.0}
    assert told == ["the parameter mapping of the system: the parameter set has no 'p.missing' to be mapped"]


def test_mapped_values_are_converted_first(tmp_path: Path) -> None:
    """A transformation could be applied to millimetres where its author meant metres."""
    content = values(g=("Real", 500)).replace('value="500"', 'value="500" unit="mm"')
    content = content.replace("</ssv:Parameters>", f"</ssv:Parameters><ssv:Units>{_SSC_UNITS}</ssv:Units>")
    mapping = '<ssm:MappingEntry source="g" target="gain"{}><ssc:LinearTransformation offset="1"/></ssm:MappingEntry>'
    for suppressed, gain in (("", 1.5), (' suppressUnitConversion="true"', 501.0)):
        whole = system("A", component("a", bindings=bound(content, mapping.format(suppressed))))
        with opened(package(tmp_path, whole)) as scenario:
            assert scenario.units["a"].parameters == {"gain": gain}


def test_sets_and_mappings_are_files_too(tmp_path: Path) -> None:
    """A package of several files could be refused, or one beside the FMU be taken for one in it."""
    binding = (
        '<ssd:ParameterBinding source="sets/g.ssv"><ssd:ParameterMapping source="sets/g.ssm"/></ssd:ParameterBinding>'
    )
    mapping = (
        f'<ssm:ParameterMapping version="1.0" {_SPACES}><ssm:MappingEntry source="g" target="gain"/>'
        "</ssm:ParameterMapping>"
    )
    files = {"sets__g_dot_ssv": values(g=("Real", 9)), "sets__g_dot_ssm": mapping}
    inside = '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component"/>'
    whole = system("A", component("a", bindings=binding) + component("b", bindings=inside))
    with opened(package(tmp_path, whole, **files)) as scenario:
        assert scenario.units["a"].parameters == {"gain": 9.0}
        assert scenario.units["b"].parameters == {"gain": 5.0}


def test_components_may_be_descriptions_and_packages(tmp_path: Path) -> None:
    """A system kept in a file of its own could be refused, or lose its values to those in it."""
    inner = system(
        "other name",
        component("c", "../m.fmu"),
        ["u -> c.u", "c.y -> y"],
        bound(values(c__gain=("Real", 1), c__u=("Real", 2))),
        u="input",
        y="output",
    )
    own = tmp_path / "own"
    own.mkdir()
    packed = package(own, inner.replace("../m.fmu", "m.fmu")).read_bytes()
    for kind, source in (("ssp-definition", "sub/inner.ssd"), ("ssp-package", "inner.ssp")):
        part = component("B", source, bound(values(c__gain=("Real", 7))), kind).replace(
            'name="gain" kind="parameter"', 'name="idle" kind="input"'
        )
        whole = system("A", component("a") + part, ["a.y -> B.u", "B.y -> a.u"])
        files: dict[str, str | bytes] = {"sub__inner_dot_ssd": described(inner), "inner_dot_ssp": packed}
        with opened(package(tmp_path, whole, **files)) as scenario:
            assert sorted(scenario.connections) == ["B_c.y -> a.u", "a.y -> B_c.u"]
            assert scenario.units["B_c"].parameters == {"gain": 7.0}
            assert scenario.units["B_c"].start == {"u": 2.0}


def test_what_other_tools_write_is_read(tmp_path: Path) -> None:
    """A package could be refused for an empty name of the system, or for a version's number that changes nothing."""
    whole = system("A", component("a") + component("b"), [".u -> a.u", "a.y -> b.u"], u="input")
    assert 'startElement=""' not in whole
    whole = whole.replace('startConnector="u" endElement="a"', 'startElement="" startConnector="u" endElement="a"')
    assert 'startElement=""' in whole
    path = package(tmp_path, whole)
    newer = tmp_path / "newer.ssp"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(newer, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            new.writestr(
                name, content.replace(b'version="1.0"', b'version="2.0"') if name.endswith(".ssd") else content
            )
    for each in (path, newer):
        with opened(each) as scenario:
            assert scenario.connections == ["a.y -> b.u"]


def test_of_many_values_that_nobody_has_some_are_told(tmp_path: Path) -> None:
    """The one line that matters could drown in a hundred thousand others."""
    content = values(**{f"nobody{number}": ("Real", 1) for number in range(500)})
    told: list[str] = []
    with opened(package(tmp_path, system("A", component("a", bindings=bound(content)))), told):
        assert len(told) == 21
        assert told[-1] == "and 480 more parameter values are not used"


def test_a_unit_of_measure_in_brackets_is_the_same(tmp_path: Path) -> None:
    """A package whose values are in [m], as some tools write m, could be refused; [ell] is still not m."""
    content = values(gain=("Real", 5)).replace('value="5"', 'value="5" unit="[m]"')
    with opened(package(tmp_path, system("A", component("a", bindings=bound(content))))) as scenario:
        assert scenario.units["a"].parameters == {"gain": 5.0}
    other = package(tmp_path, system("A", component("a", bindings=bound(content.replace("[m]", "[ell]")))))
    with pytest.raises(InputError, match=r"'\[ell\]' is not defined"), opened(other):
        pass


_TABLE = (
    '<ssm:MappingEntry source="g" target="gain"><ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="2"/>'
    "</ssc:IntegerMappingTransformation></ssm:MappingEntry>"
)


def test_a_value_that_a_table_does_not_name_is_kept(tmp_path: Path) -> None:
    """A package with a partial table, which the standard allows (SSP 1.0.1, section 4.5.2.3), could be refused."""
    for given, taken in ((1, 2), (3, 3)):
        whole = system("A", component("a", bindings=bound(values(g=("Integer", given)), _TABLE)))
        with opened(package(tmp_path, whole)) as scenario:
            assert scenario.units["a"].parameters == {"gain": taken}


_LINEAR = '<ssm:MappingEntry source="g" target="word"><ssc:LinearTransformation factor="2"/></ssm:MappingEntry>'


@pytest.mark.parametrize(
    ("whole", "words"),
    [
        (
            system("A", component("a") + system("B", component("c"), ["u -> c.u", "c.y -> u"], u="input")),
            "does not go from an output to an input",
        ),
        (system("A", component("a") + _INNER, ["a.y -> B.u", "B.y -> B.u"]), "the input B.u has more than one source"),
        (system("A", component("a") + _INNER, ["a.y -> B.v"]), "component 'B' has no connector 'v'"),
        (
            system(
                "A",
                system("B", component("c"), ["u -> y"], u="input", y="output") + component("a"),
                ["B.y -> B.u", "B.y -> a.u"],
            ),
            "form a circle",
        ),
        (
            system("A", component("a") + component("b"), ["a.y -> b.gain"]),
            "the parameter b.gain is connected to the output a.y",
        ),
        (
            system(
                "A", component("a", "mm.fmu") + system("B", component("c"), ["u -> c.u"], u="input K"), ["a.y -> B.u"]
            ),
            "mm and K measure different things",
        ),
        (
            system("A", component("a") + system("B", component("c"), ["u -> c.u"], u="input ell"), ["a.y -> B.u"]),
            "'ell' is not defined",
        ),
        (
            system("A", component("a") + system("B", component("c"), ["u -> c.u"], u="inout"), ["a.y -> B.u"]),
            "is of the kind inout",
        ),
        (
            system("A", component("a") + component("b"), ['a.y -> b.u |  | <ssc:LinearTransformation factor="INF"/>']),
            "the factor is inf",
        ),
        (system("A", component("a", bindings=bound(values(gain=("Real", "NaN"))))), "'gain' is nan"),
        (system("A", component("a", bindings=bound(values(kind=("Enumeration", "x"))))), "has no item 'x'"),
        (system("A", component("a", bindings=bound(values(g=("Real", 3)), _TABLE))), "a table for the type Integer"),
        (
            system("A", component("a", bindings=bound(values(g=("String", 3)), _TABLE.replace("Integer", "String")))),
            "does not follow the schema of SSP 1.0",
        ),
        (
            system(
                "A",
                component(
                    "a", bindings=bound(values(g=("Real", 3)), '<ssm:MappingEntry source="g" target="gain"/>' * 2)
                ),
            ),
            "several parameters are mapped to 'gain'",
        ),
        (
            system("A", component("a", bindings=bound(values(g=("String", 3)), _LINEAR))),
            "cannot be transformed linearly",
        ),
        (system("A", component("B", "SystemStructure.ssd", kind="ssp-definition")), "refers to itself"),
        (
            system(
                "A",
                component("B", "self.ssd", kind="ssp-definition") + component("C", "self.ssd", kind="ssp-definition"),
            ),
            "refers to itself",
        ),
        (system("A", component("B", "../x.ssd", kind="ssp-definition")), "outside of the package"),
        (system("A", component("B", "%2e%2e/x.ssd", kind="ssp-definition")), "outside of the package"),
        (system("A", component("B", "/etc/passwd")), "outside of the package"),
        (system("A", component("B", "file:/etc/passwd")), "not in the package"),
        (system("A", component("B", "a%00b")), "not in the package"),
        (system("A", component("B", "x" * 5000)), "not in the package"),
        (system("A", component("B", kind="fmu-javascript")), "only FMUs"),
        (system("A", system("B", "")), "no components"),
        (
            system("A", component("a") + '<ssd:SignalDictionaryReference name="bus" dictionary="d"/>'),
            "signal dictionary",
        ),
    ],
)
def test_what_cannot_be_coupled_is_refused_in_one_message(whole: str, words: str, tmp_path: Path) -> None:
    """A person could get a traceback, or a run without a connection that could not be made."""
    inner = system(
        "A", component("B", "self.ssd", kind="ssp-definition") + component("C", "self.ssd", kind="ssp-definition")
    )
    path = package(tmp_path, whole, self_dot_ssd=described(inner))
    with pytest.raises(InputError) as caught, opened(path):
        pass
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 700


def _annotated(content: str) -> str:
    own = f'<ssc:Annotation type="cardiac-cosim.scenario"><x>{content}</x></ssc:Annotation>'
    return f"<ssd:Annotations>{own}</ssd:Annotations>"


_RUN = {"stop_ms": 1000.0}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("[" * 100_000, "cannot be read (RecursionError"),
        ('{"run": ' + '{"a": ' * 100_000, "cannot be read (RecursionError"),
        ('{"run": {"stop_ms": ' + "9" * 5000 + "}}", "cannot be read (ValueError"),
        ('{"run": {"stop_ms": 1000.0}, "coupling": {"step_ms": 1e999}}', "'coupling.step_ms'"),
        ('{"run": {"stop_ms": 1000.0}, "output": {"every_ms": NaN}}', "'output.every_ms'"),
        (" " * 1_000_001, "more than 1000000 characters"),
        (json.dumps({"run": _RUN, "units": {"a": {"fmu": "/etc/passwd"}}}), "'units' does not belong there"),
        (json.dumps({"run": _RUN, "connections": ["a.y -> a.u"]}), "'connections' does not belong there"),
        (json.dumps({"run": _RUN, "every": [1]}), "'every' does not belong there, or is not a section"),
        (json.dumps({"run": _RUN, "every": {"a": {"b": 1}}}), "'units.a.every'"),
        (json.dumps({"run": _RUN | {"workers": "tcp://example.org:8786"}}), "must not choose other machines"),
        (json.dumps({"run": _RUN, "scene": {"mesh": "/etc/passwd"}}), "outside of the package"),
        (json.dumps({"run": _RUN, "scene": {"mesh": "../../x.msh"}}), "outside of the package"),
        (json.dumps({"run": _RUN, "coupling": {"step_ms": "x" * 100_000}}), "'coupling.step_ms'"),
        (json.dumps({"run": _RUN, "output": {"probes_mm": {"\x1b[31m": [0, 0, 0]}}}), "output.probes_mm"),
    ],
)
def test_annotations_are_no_way_around(content: str, words: str, tmp_path: Path) -> None:
    """A stranger's package could read other files, send units to other machines, or end in a traceback."""
    path = package(tmp_path, system("A", component("a")), _annotated(content))
    with pytest.raises(InputError) as caught, opened(path):
        pass
    assert words in str(caught.value)
    assert len(str(caught.value)) < 1000
