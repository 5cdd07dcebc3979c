"""If these fail, a variable of somebody's FMU is lost, or arrives as another value than the FMU gave."""

import json
import re
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_box
import pytest
from cardiac_cosim.orchestrator.errors import InputError, RunError
from cardiac_cosim.orchestrator.run import run_scenario, show_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from written import rows

pytestmark = pytest.mark.skipif(build_box.compiler() is None, reason="no C compiler to build foreign FMUs with")

_TYPES = (
    "<TypeDefinitions><SimpleType name='Mode'><Enumeration><Item name='off' value='1'/><Item name='on' value='4'/>"
    "<Item name='more' value='5'/></Enumeration></SimpleType>"
    "<SimpleType name='Length'><Real unit='mm'/></SimpleType></TypeDefinitions>"
)

#: One of everything.
_ALL = [
    ("u", "Real", "input", 0),
    ("y", "Real", "output", 16),
    ("n", "Integer", "input", 0),
    ("m", "Integer", "output", 16),
    ("b", "Boolean", "input", 0),
    ("c", "Boolean", "output", 16),
    ("s", "String", "input", 0),
    ("t", "String", "output", 16),
    ("e", "Enumeration", "input", 1, "", 'declaredType="Mode" start="1"'),
    ("f", "Enumeration", "output", 17, "", 'declaredType="Mode"'),
    ("time reached", "Real", "local", 32),
    ("dud", "Real", "parameter", 33, 'variability="fixed"', 'start="7"'),
]

Simulate = Callable[..., list[dict[str, str]]]


@pytest.fixture
def simulate(tmp_path: Path) -> Simulate:
    """Run `a` and `b`, which are described as given, for three steps of a second; the rows of the time series."""

    def run(
        a: Any, b: Any = None, extra: str = "", *sets: str, head: str = _TYPES, **rest: Any
    ) -> list[dict[str, str]]:
        build_box.build_box(tmp_path / "a.fmu", a, head, **rest)
        build_box.build_box(tmp_path / "b.fmu", _ALL if b is None else b, head)
        units = {"a": {"fmu": "a.fmu"} | _given(a), "b": {"fmu": "b.fmu"} | _given(_ALL if b is None else b)}
        (tmp_path / "s.yaml").write_text(
            f"name: s\nunits: {json.dumps(units)}\nconnect_by_name: false\ncoupling: {{step_ms: 1000}}\n"
            f"run: {{stop_ms: 3000}}\noutput: {{every_ms: 3000}}\n{extra}",
            encoding="utf-8",
        )
        run_scenario(load_scenario(tmp_path / "s.yaml", sets), tmp_path, tmp_path / "out")
        return rows(tmp_path / "out")

    return run


def _given(variables: Any) -> dict[str, Any]:
    """The start values that are declared of Reals: the library knows nothing of its description."""
    found: dict[str, Any] = {"parameters": {}, "start": {}}
    for name, kind, causality, _, *rest in variables:
        start = re.search(r'start="(.*?)"', " ".join(rest))
        if kind == "Real" and start:
            found["parameters" if causality == "parameter" else "start"][name] = float(start[1])
    return found


def _column(rows: list[dict[str, str]], name: str) -> list[str]:
    return [row[name] for row in rows]


def test_variables_of_all_types_are_recorded_and_connected(simulate: Simulate) -> None:
    links = "connections: [a.m -> b.n, a.c -> b.b, a.t -> b.s, a.m -> b.u, a.f -> b.e]\n"
    rows = simulate(_ALL, extra=links)
    # What `a` makes of its start values, and what `b` makes of that; nothing of it is interpolated.
    assert _column(rows, "a.m") == ["1"] * 4
    assert _column(rows, "b.m") == ["2"] * 4
    assert _column(rows, "a.c") == ["1"] * 4
    assert _column(rows, "b.c") == ["0"] * 4
    assert _column(rows, "a.t") == ["<>"] * 4
    assert _column(rows, "b.t") == ["<<>>"] * 4
    assert _column(rows, "b.y") == ["0.0", "1.0", "2.0", "3.0"]


@pytest.mark.parametrize(
    ("link", "types"),
    [
        ("a.y -> b.n", "Real -> Integer"),
        ("a.y -> b.b", "Real -> Boolean"),
        ("a.m -> b.b", "Integer -> Boolean"),
        ("a.t -> b.u", "String -> Real"),
        ("a.m -> b.s", "Integer -> String"),
        ("a.f -> b.u", "Enumeration -> Real"),
        ("a.y -> b.e", "Real -> Enumeration"),
    ],
)
def test_types_that_do_not_go_together_are_both_named(simulate: Simulate, link: str, types: str) -> None:
    with pytest.raises(InputError, match=f"the types differ, {types}"):
        simulate(_ALL, extra=f"connections: ['{link}']\n")


def test_an_enumeration_takes_only_the_numbers_of_its_items(simulate: Simulate) -> None:
    with pytest.raises(RunError, match="'e' of type Enumeration cannot be 2"):
        simulate(_ALL, extra="connections: [a.m -> b.n, b.m -> b.e]\n")


def test_a_law_makes_real_numbers_of_others_and_nothing_else(simulate: Simulate) -> None:
    rows = simulate(_ALL, extra="connections: ['a.c * 10 + 1 -> b.u']\n")
    assert _column(rows, "b.y") == ["0.0", "11.0", "22.0", "33.0"]
    with pytest.raises(InputError, match="a law gives real numbers, but the input is of the type Integer"):
        simulate(_ALL, extra="connections: ['a.m * 10 -> b.n']\n")


def test_what_is_recorded_can_be_chosen(simulate: Simulate) -> None:
    rows = simulate(_ALL, None, "", "output.variables=[b.time reached, a.dud, 'b.?', a.y]")
    assert [*rows[0]] == ["time_ms", "dud", "a.y", "time reached", "u", "b.y", *"nmbcstef"]
    assert _column(rows, "time reached") == ["0.0", "1.0", "2.0", "3.0"]
    assert _column(rows, "dud") == ["7.0"] * 4
    with pytest.raises(InputError, match="unit 'b' has no variable 'tim reached'; did you mean 'time reached'"):
        simulate(_ALL, None, "", "output.variables=[b.tim reached]")
    with pytest.raises(InputError, match=r"'c\.y' is of no unit"):
        simulate(_ALL, None, "", "output.variables=[c.y]")


def test_units_of_measure_come_from_declared_types(simulate: Simulate) -> None:
    a = [("x", "Real", "output", 16, "", 'declaredType="Length"')]
    b = [("u", "Real", "input", 0, "", 'unit="m"'), ("y", "Real", "output", 16)]
    with pytest.raises(InputError, match="the units of measure differ, mm -> m"):
        simulate(a, b, "connections: [a.x -> b.u]\n")
    assert "x_mm" in simulate(a, b)[0]


@pytest.mark.parametrize(
    ("names", "recorded"),
    [
        (("y[1]", "y[2]"), ["y[1]", "y[2]"]),
        (("y[0]", "y[1]"), ["y[0]", "y[1]"]),
        (("y[1]", "y[3]"), ["y[1]", "y[3]"]),
        (("y", "y[1]"), ["y", "y[1]"]),
        (("höhe in °", "der(x).'a -> b'"), ["höhe in °", "der(x).'a -> b'"]),
        (("y * 2", 'q"[1,1]'), ["y * 2", 'q"[1,1]']),
        (("y[01]", "y[1]"), ["y[01]", "y[1]"]),
        (("y[99999999999999999999]", "."), ["y[99999999999999999999]", "."]),
    ],
)
@pytest.mark.parametrize("form", ["text", "entry"])
def test_variables_are_connected_by_whatever_names_they_have(
    names: tuple[str, str], recorded: list[str], form: str, simulate: Simulate
) -> None:
    a = [("u", "Real", "parameter", 0, "", 'start="3"'), ("v", "Real", "parameter", 1, "", 'start="5"')]
    a += [(name, "Real", "output", 16 + place) for place, name in enumerate(names)]
    b = [("in 1", "Real", "input", 0), ("in[7]", "Real", "input", 1), ("x", "Real", "output", 16)]
    b += [("z", "Real", "output", 17)]
    ends = zip(names, ["in 1", "in[7]"], strict=True)
    links: list[Any] = [{"from": "a", "output": name, "to": "b", "input": to} for name, to in ends]
    if form == "text":
        links = [f"a.{names[0]} -> b.in 1", f"a.{names[1]} -> b.in[7]"]
    rows = simulate(a, b, f"connections: {json.dumps(links, ensure_ascii=False)}\n")
    assert [*rows[0]] == ["time_ms", *recorded, "x", "z"]
    # Held inputs are those of the step's end.
    assert [_column(rows, name)[-1] for name in (*recorded, "x", "z")] == ["9.0", "15.0", "18.0", "30.0"]


def test_what_can_be_read_in_two_ways_is_to_be_written_as_an_entry(simulate: Simulate) -> None:
    a = [("y", "Real", "output", 16), ("y * 2", "Real", "output", 17)]
    b = [("u", "Real", "input", 0)]
    with pytest.raises(InputError, match=r'several ways; write it as an entry, \{"from": "a", "output": "y \* 2"'):
        simulate(a, b, "connections: [a.y * 2 -> b.u]\n")


def test_connections_are_shown_as_they_can_be_written(simulate: Simulate, tmp_path: Path) -> None:
    a = [("y - 1", "Real", "output", 16), ("y -> b.u", "Real", "output", 17), ("y out", "Real", "output", 18)]
    b = [("u", "Real", "input", 0), ("v", "Real", "input", 1), ("w", "Real", "input", 2)]
    ends = [(one[0], other[0]) for one, other in zip(a, b, strict=True)]
    entries: list[Any] = [{"from": "a", "output": name, "to": "b", "input": to} for name, to in ends]
    entries[0] |= {"factor": 2.0, "offset": -1.0}
    simulate(a, b, f"connections: {json.dumps(entries)}\n")
    shown = show_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path)
    lines = [line.strip() for line in shown.split("\nconnections\n")[1].split("\n\n")[0].splitlines()]
    assert lines[2] == "a.y out -> b.w"
    again = ", ".join(line if line.startswith("{") else json.dumps(line) for line in lines)
    (tmp_path / "s.yaml").write_text((tmp_path / "s.yaml").read_text().replace(json.dumps(entries), f"[{again}]"))
    assert show_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path) == shown


def test_elements_are_connected_to_scalars_and_to_each_other(simulate: Simulate) -> None:
    a = [(f"p{place}", "Real", "parameter", place, "", f'start="{place + 1}"') for place in range(3)]
    a += [(f"y[{place + 1}]", "Real", "output", 16 + place) for place in range(3)]
    b = [(f"u[{place}]", "Real", "input", place, "", 'start="100"') for place in range(3)]
    b += [("w[1]", "Real", "input", 3)]
    b += [(f"z[{place}]", "Real", "output", 16 + place) for place in range(4)]
    links = "connections: ['a.y[3] -> b.u[0]', 'a.y[1] -> b.u[2]', 'a.y[2] -> b.w']\n"
    rows = simulate(a, b, links)
    # What is not connected keeps its start value.
    assert [_column(rows, f"z[{place}]")[-1] for place in range(4)] == ["18.0", "300.0", "6.0", "12.0"]
    for link, words in (
        ("['a.y[4] -> b.w']", r"no output 'y\[4\]'; the array y has the elements y\[1\] to y\[3\]"),
        ("['a.y[1] -> b.u[1]', 'a.y -> b.u']", r"the input b\.u has more than one source"),
        ("['a.y -> b.u', 'a.y[1] -> b.u[1]']", r"the input b\.u\[1\] has more than one source"),
        ("['a.y -> b.w']", r"the shapes differ, \(3,\) -> \(1,\).*'a\.y\[1\] -> b\.w\[1\]'"),
    ):
        with pytest.raises(InputError, match=words):
            simulate(a, b, f"connections: {link}\n")


@pytest.mark.parametrize(
    "steps", ["coupling.scheme=jacobi", "coupling.extrapolation=2", "coupling.adaptive={min_ms: 1}"]
)
def test_discrete_values_are_held_whatever_is_done_to_others(simulate: Simulate, steps: str) -> None:
    b = [("u", "Real", "input", 0), ("y", "Real", "output", 16), ("n", "Integer", "input", 0)]
    b += [("m", "Integer", "output", 16), ("s", "String", "input", 0), ("t", "String", "output", 16)]
    # m follows itself, a step late, and is 1, 2, 3, …: nothing in between is ever seen.
    rows = simulate(_ALL, b, "connections: [b.m -> b.n, b.m -> b.u, b.m -> a.n, b.t -> b.s]\n", steps)
    assert all(float(value).is_integer() for value in _column(rows, "b.m"))
    assert _column(rows, "b.m")[:2] == ["1", "2"]
    assert _column(rows, "b.t")[:3] == ["<>", "<<>>", "<<<>>>"]
    assert float(rows[-1]["b.m"]) == len(rows)


def test_a_run_with_texts_goes_on_from_a_checkpoint(simulate: Simulate, tmp_path: Path, stopped: Any) -> None:
    links = "connections: [b.m -> b.n, b.t -> b.s, b.c -> b.b, b.y -> b.u]\n"
    whole = simulate(_ALL, None, links, "run.checkpoint_every=1")
    scenario = load_scenario(tmp_path / "s.yaml", ["run.checkpoint_every=1"])
    stopped(2, scenario, tmp_path, tmp_path / "out")
    run_scenario(scenario, tmp_path, tmp_path / "out", resume=True)
    assert rows(tmp_path / "out") == whole


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ([("x", "Real", "output", 16), ("x", "Integer", "input", 0)], "two of its variables are named 'x'"),
        ([("x", "Real", "output", 2**32 + 16)], "'x' has no valid value reference: 4294967312"),
        (
            [("x", "Real", "output", 16, "", 'declaredType="Nothing"')],
            "'x' is of the type 'Nothing', which it does not define",
        ),
        ([("x", "Colour", "output", 16)], "variable 'x' has no type"),
        ([("", "Real", "output", 16)], "one of its variables has no name"),
    ],
)
def test_descriptions_that_contradict_themselves_are_refused(simulate: Simulate, variables: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulate(variables)


def test_an_enumeration_without_numbers_is_refused(simulate: Simulate) -> None:
    with pytest.raises(InputError, match="the item 'off' of its type 'Mode' has a value that is not a whole number"):
        simulate(_ALL, head=_TYPES.replace("value='1'", "value='one'"))


def test_a_library_that_needs_another_one_is_told_apart_from_a_damaged_one(simulate: Simulate, tmp_path: Path) -> None:
    simulate(_ALL)
    (tmp_path / "other.c").write_text("int other(void) { return 1; }")
    (tmp_path / "box.c").write_text("int other(void); int fmi2DoStep(void) { return other(); }")
    for command in (["other.c", "-o", "libother.so"], ["box.c", "-L.", "-lother", "-o", "box.so"]):
        subprocess.run(["cc", "-shared", "-fPIC", *command], cwd=tmp_path, check=True)
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        (library,) = [name for name in archive.namelist() if "binaries" in name]
        text = archive.read("modelDescription.xml")

    def packed(content: bytes) -> None:
        with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
            archive.writestr(library, content)
            archive.writestr("modelDescription.xml", text)

    scenario = load_scenario(tmp_path / "s.yaml")
    packed((tmp_path / "box.so").read_bytes())
    with pytest.raises(InputError, match=r"because it needs another one: libother\.so"):
        run_scenario(scenario, tmp_path, tmp_path / "out")
    packed((tmp_path / "libother.so").read_bytes())
    with pytest.raises(InputError, match=r"its library is incomplete: .*undefined symbol: fmi2"):
        run_scenario(scenario, tmp_path, tmp_path / "out")


def test_a_second_instance_of_an_fmu_that_allows_one_needs_a_process_of_its_own(tmp_path: Path) -> None:
    build_box.build_box(tmp_path / "a.fmu", _ALL, _TYPES, 'canBeInstantiatedOnlyOncePerProcess="true"')
    (tmp_path / "s.yaml").write_text(
        "name: s\nunits: {a: {fmu: a.fmu}, b: {fmu: a.fmu}}\nconnect_by_name: false\nrun: {stop_ms: 5}\n"
    )
    with pytest.raises(InputError, match=r"^unit 'b': .*only once per process .* unit 'a' already uses it"):
        run_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path, tmp_path / "out")
    # One after the other is no trouble.
    scenario = load_scenario(tmp_path / "s.yaml", ["units={a: {fmu: a.fmu}}"])
    for _ in range(2):
        run_scenario(scenario, tmp_path, tmp_path / "out")


def test_an_fmu_may_be_a_folder(simulate: Simulate, tmp_path: Path) -> None:
    packed = simulate(_ALL)
    with zipfile.ZipFile(tmp_path / "a.fmu") as archive:
        archive.extractall(tmp_path / "a folder")
    scenario = load_scenario(tmp_path / "s.yaml", ["units.a.fmu=a folder"])
    run_scenario(scenario, tmp_path, tmp_path / "out")
    assert rows(tmp_path / "out") == packed
    assert (tmp_path / "a folder" / "modelDescription.xml").is_file()


def test_showing_a_scenario_runs_nobodys_code(simulate: Simulate, tmp_path: Path) -> None:
    simulate(_ALL)
    with zipfile.ZipFile(tmp_path / "a.fmu", "a") as archive:
        (library,) = [name for name in archive.namelist() if "binaries" in name]
        text = archive.read("modelDescription.xml")
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as archive:
        archive.writestr(library, b"no library at all")
        archive.writestr("modelDescription.xml", text)
    scenario = load_scenario(tmp_path / "s.yaml")
    assert "out t, scalar" in show_scenario(scenario, tmp_path)
    here = Path.cwd()
    with pytest.raises(InputError, match="its library is damaged, or made for another machine"):
        run_scenario(scenario, tmp_path, tmp_path / "out")
    assert Path.cwd() == here


def test_all_that_an_fmu_logs_is_in_a_file(simulate: Simulate, tmp_path: Path) -> None:
    simulate(_ALL)
    log = tmp_path / "out" / "fmu.log"
    assert not log.exists()
    texts = []
    for workers in ("null", "processes"):
        simulate(_ALL, None, "", f"run.workers={workers}", talks=True)
        texts.append([line.split("\t") for line in log.read_text().splitlines()])
    entries = texts[0]
    assert [entry[:4] for entry in texts[0]] == [entry[:4] for entry in texts[1]]
    # Three steps and a warning, and a second line of three of them, which is indented.
    assert len(entries) == 7
    assert entries[0] == ["0 s", "a", "ok", "logAll", "at 1.000 s: 100 % of it"]
    assert entries[1] == ["", "and a second line"]
    # A plain message that is no format: whatever becomes of it, it is told, and nobody is harmed.
    assert entries[2][:4] == ["0 s", "a", "warning", "logAll"]
    assert entries[2][4].startswith("50")
    assert entries[-2][:3] == ["2 s", "a", "ok"]
    # What is there of an earlier run does not pass for this one's.
    simulate(_ALL)
    assert not log.exists()


_NUMBERS = ["Float32", "Float64", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))]


def _declared3() -> str:
    """Every type of FMI 3.0 as input `u`, output `y`, and as an array of three of each, `us` and `ys`."""
    lines = []
    for kind in [*_NUMBERS, "Boolean", "String"]:
        start = {"Boolean": "false", "String": ""}.get(kind, "0")
        for place, (name, causality) in enumerate((("u", "input"), ("y", "output"), ("us", "input"), ("ys", "output"))):
            # In FMI 3.0 value references are unique over all types, which is nothing to this library.
            extra = "" if kind in ("Float32", "Float64") else ' variability="discrete"'
            begin = f' start="{start}"' if causality == "input" and kind != "String" else ""
            inside = '<Dimension start="3"/>' if name.endswith("s") else ""
            lines.append(
                f'<{kind} name="{name}{kind}" valueReference="{place}" causality="{causality}"{extra}{begin}>'
                f"{inside}</{kind}>"
            )
    return "".join(lines)


def _run3(folder: Path, connections: list[str], *sets: str, early: bool = False) -> list[dict[str, str]]:
    for unit in "ab":
        build_box.build_box3(folder / f"{unit}.fmu", _declared3(), early)
    (folder / "s.yaml").write_text(
        "name: s\nunits: {a: {fmu: a.fmu}, b: {fmu: b.fmu}}\nconnect_by_name: false\ncoupling: {step_ms: 1000}\n"
        f"run: {{stop_ms: 3000}}\noutput: {{every_ms: 3000}}\nconnections: {json.dumps(connections)}\n"
    )
    run_scenario(load_scenario(folder / "s.yaml", sets), folder, folder / "out")
    return rows(folder / "out")


def test_all_types_of_fmi_3_are_exchanged_and_recorded(tmp_path: Path) -> None:
    kinds = [*_NUMBERS, "Boolean", "String"]
    links = [f"a.y{kind} -> b.u{kind}" for kind in kinds] + [f"a.ys{kind} -> b.us{kind}" for kind in kinds]
    row = _run3(tmp_path, links)[-1]
    for kind in kinds:
        expected = {"Boolean": ("1", "0"), "String": ("<>", "<<>>")}.get(kind, ("1", "2"))
        if kind.startswith("Float"):
            expected = ("1.0", "2.0")
        assert (row[f"a.y{kind}"], row[f"b.y{kind}"]) == expected
        assert (row[f"a.ys{kind}[3]"], row[f"b.ys{kind}[3]"]) == expected


def test_elements_of_arrays_of_fmi_3_are_set_without_touching_the_others(tmp_path: Path) -> None:
    links = ["a.yFloat64 -> b.usFloat64[2]", "a.ysInt32[1] -> b.usInt64[3]", "a.yUInt8 -> b.uFloat32"]
    row = _run3(tmp_path, links, "units.b.start={usFloat64: 5}")[-1]
    assert [row[f"b.ysFloat64[{place}]"] for place in (1, 2, 3)] == ["6.0", "2.0", "6.0"]
    assert [row[f"b.ysInt64[{place}]"] for place in (1, 2, 3)] == ["1", "1", "2"]
    assert row["b.yFloat32"] == "2.0"


def test_a_number_that_a_type_cannot_hold_ends_the_run(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="'uInt8' of type Int8 cannot be 201"):
        _run3(tmp_path, ["a.yInt32 -> b.uInt8"], "units.a.start={uInt32: 200}")


def test_a_step_that_ends_early_without_being_allowed_to_is_no_step(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"returned from its step early, at 2\.5 s"):
        _run3(tmp_path, [], early=True)


def test_variables_of_our_own_units_are_chosen_alike_directly_and_through_fmus(tmp_path: Path, fmu_dir: Path) -> None:
    (tmp_path / "s.yaml").write_text(
        "name: cell\nscene: {geometry: cell}\nunits: {tension: {unit: active_stress}}\nrun: {stop_ms: 3}\n"
        "output: {every_ms: 3, variables: ['tension.*']}\n"
    )
    texts = []
    for kind in ("native", "fmu"):
        scenario = load_scenario(tmp_path / "s.yaml", [f"run.participants={kind}"])
        run_scenario(scenario, tmp_path, tmp_path / kind, fmu_dir=fmu_dir)
        texts.append((tmp_path / kind / "timeseries.csv").read_text())
    assert texts[0] == texts[1]
    # Parameters, texts among them, inputs and outputs, with their units of measure once.
    assert {"delay_function", "potential[1]_mV", "active_stress[1]_kPa"} <= set(texts[0].splitlines()[0].split(","))
