"""A scenario of some lines could fill the memory, take minutes, or end in a traceback."""

import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.errors import InputError, did_you_mean
from cardiac_cosim.orchestrator.quoting import quoted
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.orchestrator.untrusted.yaml_text import parse_yaml

GIBIBYTE = 2**30

SMALL = """\
name: small
scene: {geometry: cell, mesh_size_mm: 5}
units:
  fibers: {unit: fiber_generator}
run: {stop_ms: 10, participants: native}
"""


def _laughs(pattern: str, first: str) -> str:
    """Ten times the one before, thirty times."""
    lines = [f"l0: &l0 {first}"]
    for level in range(1, 30):
        lines.append(f"l{level}: &l{level} {pattern.format(*[f'*l{level - 1}'] * 10)}")
    return "\n".join(lines)


_LIST = "[{}, {}, {}, {}, {}, {}, {}, {}, {}, {}]"

_CHAIN = "l0: &l0 1\n" + "".join(f"l{i + 1}: &l{i + 1} [*l{i}]\n" for i in range(1000))

#: What the message has to say.
WEAPONS: dict[str, tuple[str | bytes, str]] = {
    "billion laughs": (SMALL + _laughs(_LIST, "[ha]"), "aliases written out"),
    "laughs by merging": (SMALL + _laughs("{{<<: " + _LIST + "}}", "{a: 1}"), "aliases written out"),
    "laughs in keys": (SMALL + _laughs("{{? " + _LIST + " : 1}}", "[ha]"), "aliases written out"),
    "a chain of aliases": (SMALL + _CHAIN, "nested too deeply"),
    "itself": (SMALL + "a: &a {b: *a}\n", "contains itself"),
    "itself by merging": (SMALL + "a: &a {<<: *a}\n", "contains itself"),
    "deep list": (SMALL + "connections: " + "[" * 100_000, "nested too deeply"),
    "deep section": (SMALL + "connections: " + "{a: " * 100_000, "nested too deeply"),
    "deep block": (SMALL + "".join(" " * i + "a:\n" for i in range(2000)), "nested too deeply"),
    "deep dashes": (SMALL + "a:\n  " + "- " * 100_000, "nested too deeply"),
    "deep questions": (SMALL + "? " * 100_000, "nested too deeply"),
    "many": (SMALL + "connections: [" + "1," * 51_000 + "]", "more than 50000"),
    "huge": (SMALL + "#" * 11_000_000, "more than 10 MB"),
    "long text": (SMALL + f"connections: {'x' * 1_000_000}", "'connections' is 'xxx"),
    "long key": (SMALL + f"? {'x' * 1_000_000}\n: 1", "unknown key 'xxx"),
    "long name": (SMALL.replace("name: small", f"name: {'x' * 300}"), "300 bytes"),
    "long name of umlauts": (SMALL.replace("name: small", f"name: {'ä' * 120}"), "240 bytes"),
    "long unit": (SMALL.replace("fibers:", f"{'x' * 300}:"), "300 bytes"),
    "long path": (SMALL.replace("{unit: fiber_generator}", f"{{fmu: {'x' * 300}}}"), "300 bytes"),
    "long paths": (SMALL.replace("geometry: cell, mesh_size_mm: 5", f"mesh: {'x/' * 3000}"), "6000 bytes"),
    "long number": (SMALL.replace("10", "9" * 5000), "a number of 5000 digits"),
    "long hexadecimal": (SMALL.replace("10", "0x" + "f" * 1_000_000), "digits"),
    "hexadecimal": (SMALL.replace("10", "0x" + "f" * 900), "a number of about 1084 digits"),
    "long hexadecimals in a list": (SMALL.replace("10", "[0x" + "f" * 900 + "]"), "a number of about 1084 digits"),
    "long sexagesimal": ("%YAML 1.1\n---\n" + SMALL.replace("10", "1" + ":00" * 100_000), "digits"),
    "tagged number": (SMALL.replace("10", '!!int "' + "9" * 5000 + '"'), "digits"),
    "beyond floats": (SMALL.replace("10", "1e400"), "'run.stop_ms' is inf"),
    "no number": (SMALL.replace("10", ".nan"), "'run.stop_ms' is nan"),
    "end of a string": (SMALL.replace("{unit: fiber_generator}", '{fmu: "a\\0b.fmu"}'), "not plain text"),
    "end of a string in a key": (SMALL + '"a\\0": 1', "not plain text"),
    "half a character": (SMALL.replace("{unit: fiber_generator}", '{fmu: "\\uD800"}'), "not plain text"),
    "colours": (SMALL + '"\\e[31m\\e[2J": 1', "unknown key ' [31m [2J'"),
    "lines": (SMALL + '"a\\nerror: b": 1', "unknown key 'a error: b'"),
    "python": (SMALL + "a: !!python/object/apply:os.system [echo]", "constructor for the tag"),
    "python name": (SMALL + "a: !!python/name:os.system", "constructor for the tag"),
    "own tag": (SMALL + f"a: !{'x' * 100_000} 1", "constructor for the tag"),
    "duplicate": (SMALL + "name: other", 'duplicate key "name"'),
    "long duplicate": (SMALL + f"? {'x' * 100_000}\n: 1\n? {'x' * 100_000}\n: 1", "duplicate key"),
    "list as key": (SMALL + "? [1, 2]\n: 3", "a key has to be text"),
    "section as key": (SMALL + "? {1: 2}\n: 3", "no"),
    "date as key": (SMALL + "2020-01-01: 3", "a key has to be text"),
    "truth as key": (SMALL + "true: 3", "a key has to be text"),
    "nothing as key": (SMALL + "~: 3", "a key has to be text"),
    "number as key": (SMALL + "1: 3", "a key has to be text"),
    "long number as key": (SMALL + f"0x{'f' * 900}: 3", "a key has to be text"),
    "date": (SMALL.replace("10", "2020-01-01"), "expected a number"),
    "moment": (SMALL.replace("10", "2020-01-01T10:00:00Z"), "expected a number"),
    "set": (SMALL.replace("10", "!!set {a, b}"), "expected a number"),
    "ordered": (SMALL.replace("10", "!!omap [a: 1]"), "expected a number"),
    "bytes": (SMALL.replace("10", "!!binary aGVsbG8="), "expected a number"),
    "bytes of a unit": (SMALL.replace("fiber_generator", "!!binary aGVsbG8="), "expected a text"),
    "bad bytes": (SMALL.replace("10", "!!binary ä"), "not valid YAML"),
    "other version": ("%YAML 9.9\n---\n" + SMALL, "not valid YAML"),
    "many problems": (SMALL + "".join(f"a{i}: 1\n" for i in range(1000)), "and 980 more problems"),
    "binary": (bytes(range(256)) * 1000, "not a text file"),
    "half of UTF-16": (SMALL.encode("utf-16")[:-1], "not a text file"),
    "UTF-16 without mark": (SMALL.encode("utf-16-le"), "not a text file"),
    "UTF-32": (SMALL.encode("utf-32"), "not a text file"),
    "latin": (SMALL.replace("small", "äh").encode("latin-1"), "not a text file"),
    "a scalar": ("5", "lines `key: value`"),
    "an image of one": (b"\x89PNG\r\n\x1a\n" + bytes(1000), "not a text file"),
}  # fmt: skip


def _refused(folder: Path, content: str | bytes, assignments: Sequence[str] = ()) -> str:
    path = folder / "scene.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError) as caught:
        load_scenario(path, assignments)
    message = str(caught.value)
    lines = message.split("\n")
    assert len(lines) <= 21
    for line in lines:
        assert line.startswith(("--set ", str(path)))
        assert len(line) < 700
        assert line.isprintable()
    return message


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("content", "words"), WEAPONS.values(), ids=WEAPONS)
def test_weapons_end_in_one_short_message(tmp_path: Path, content: str | bytes, words: str) -> None:
    assert words in _refused(tmp_path, content)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        (f"run.stop_ms={'9' * 5000}", "5000 digits"),
        (f"run.stop_ms=0x{'f' * 900}", "a number of about 1084 digits"),
        (f"{'a.' * 30_000}b=1", "write it as"),
        (f"{'x' * 60_000}=1", "unknown key"),
        (f"{'x' * 60_000}", "write it as"),
        (f"run.stop_ms={'[' * 60_000}", "nested too deeply"),
        (f"run.stop_ms=&a [{'*a,' * 10}]", "contains itself"),
        ("run.stop_ms=\x1b[31m", "not a text file"),
        ("name.a.b=1", "'name' holds 'small'"),
        ("name=../x", "'name'"),
        ("name=a/b", "'name'"),
        ('name="a\\0b"', "not plain text"),
        ("units.fibers.fmu.x=1", "units.fibers"),
        ("__class__.x=1", "unknown key"),
        ("\udcff=1", "write it as"),
        ("name=\udcff", "not a text file"),
    ],
)
def test_assignments_are_no_way_around(tmp_path: Path, assignment: str, words: str) -> None:
    assert words in _refused(tmp_path, SMALL, [assignment])


def test_memory_stays_flat(tmp_path: Path) -> None:
    """The machine could be brought down by a file of one kilobyte."""
    program = (
        "import sys, pathlib\n"
        "from cardiac_cosim.orchestrator.errors import InputError\n"
        "from cardiac_cosim.orchestrator.scenario import load_scenario\n"
        "for name in sys.argv[1:]:\n"
        "    try:\n"
        "        load_scenario(pathlib.Path(name))\n"
        "    except InputError:\n"
        "        print('refused')\n"
    )
    names = []
    for number, name in enumerate(("billion laughs", "laughs by merging", "deep list", "huge")):
        content = WEAPONS[name][0]
        (tmp_path / f"{number}.yaml").write_bytes(content if isinstance(content, bytes) else content.encode())
        names.append(tmp_path / f"{number}.yaml")
    done = subprocess.run(
        [sys.executable, "-c", program, *names, "/dev/zero"],
        capture_output=True,
        text=True,
        timeout=100,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (GIBIBYTE, GIBIBYTE)),
    )
    assert done.stdout.split() == ["refused"] * 5, done.stderr


def test_sound_yaml_is_read() -> None:
    """Anchors, merged sections, marks and other encodings could be refused with the weapons."""
    text = "a: &a {x: 1, y: [1, 2]}\nb: {<<: *a, x: 2}\nc: [*a, *a]\nd: !!str 5\ne: ä"
    wanted = {
        "a": {"x": 1, "y": [1, 2]},
        "b": {"x": 2, "y": [1, 2]},
        "c": [{"x": 1, "y": [1, 2]}] * 2,
        "d": "5",
        "e": "ä",
    }
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        assert parse_yaml(text.encode(encoding)) == wanted
    many = parse_yaml("\n".join(f"- a{i}.x -> b.y{i}" for i in range(10_000)))
    assert many[-1] == "a9999.x -> b.y9999"


def test_values_are_repeated_whatever_they_are() -> None:
    """A message about a wrong value could itself fail, or be of megabytes."""
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    itself: list[object] = []
    itself.append(itself)
    for value in (
        10**10_000,
        -(10**5000),
        deep,
        [deep],
        {"a": deep},
        itself,
        "x" * 10**7,
        b"x" * 10**7,
        [10**5000] * 10**6,
        {(1, 2): 3},
        float("nan"),
        "\ud800\n\x1b",
    ):
        text = quoted(value)
        assert len(text) < 100
        assert text.isprintable()
    assert quoted([25, 0]) == "[25, 0]"
    assert quoted({"x": 25, "y": []}) == "{'x': 25, 'y': []}"
    assert quoted("x") == "'x'"
    assert quoted(True) == "True"
    assert quoted(-(10**5000)) == "a number of about 5001 digits"


def test_hints_are_short_whatever_is_known() -> None:
    """An unknown name could be compared with 60 000 others for minutes, or be answered by a list of all of them."""
    known = [f"potential[{number}]" for number in range(60_000)]
    assert len(did_you_mean("quux", known)) < 1000
    assert "60000 in all" in did_you_mean("x" * 10**6, known)
    assert did_you_mean("potentiel[7]", known).startswith("; did you mean 'potential[")
