"""Of thousands of damaged scenarios, FMUs and packages one could end in a traceback, or hang.

Each is a sound one with some places changed: bytes, or values and attributes where they are found. Loading it gives
what it is, or an InputError that a person can read. The examples are the same in every run; `pytest -m long` makes the
most.
"""

import json
import re
import shutil
import signal
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.fmus.build import build_fmu
from cardiac_cosim.orchestrator.build import build_fmus, write_package
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.participants.fmu_description import read_description
from cardiac_cosim.orchestrator.participants.fmu_file import FmuFile
from cardiac_cosim.orchestrator.participants.fmu_variables import fields, groups
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.orchestrator.ssp import open_package
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.geometry.registry import build
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree
from ruamel.yaml import YAML

_SCENARIOS = sorted((Path(__file__).parent.parent.parent.parent / "scenarios").glob("*.yaml"))

#: Seconds after which an example hangs.
_HANGS = 30

Draw = Callable[[st.SearchStrategy[Any]], Any]


def _few(examples: int) -> settings:
    return settings(
        max_examples=examples,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


@contextmanager
def _sound_or_refused(path: Path) -> Iterator[None]:
    """What is in it ends in time, with no exception but an InputError of some short lines."""

    def hang(*_: Any) -> None:
        raise TimeoutError(f"{path} hangs")

    before = signal.signal(signal.SIGALRM, hang)
    signal.alarm(_HANGS)
    try:
        yield
    except InputError as error:
        lines = str(error).split("\n")
        assert len(lines) <= 21
        for line in lines:
            assert line.strip()
            assert len(line) < 1500
            assert line.isprintable(), line
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


#: Where people and tools slip, and where attackers begin.
_TEXTS = st.sampled_from(
    [
        *("", " ", "x", "../x", "/etc/passwd", "a.b", "a[1]", "a -> b", "ä", "\U0001f600", "\x1b[2J", "%00"),
        *("nan", "INF", "-INF", "1e999", "-1", "0", "1", "0x10", "true", "null", "1,5", "1e-320"),
        *("x" * 300, "x" * 70_000, "9" * 30, "9" * 5000),
    ]
) | st.text(max_size=8)
_VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | _TEXTS
    | st.sampled_from([10**400, -(10**20), 1e308, 5e-324]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(_TEXTS, inner, max_size=3),
    max_leaves=5,
)


def _damaged_bytes(draw: Draw, content: bytes) -> bytes:
    """`content` with some places cut, doubled, or replaced."""
    for _ in range(draw(st.integers(1, 4))):
        begin = draw(st.integers(0, len(content)))
        end = min(len(content), begin + draw(st.integers(0, 12)))
        new = draw(
            st.binary(max_size=6)
            | st.sampled_from([b"", content[begin:end] * 2, b"\0", b"\xff", b"<", b"&", b"*a", b"[" * 50])
        )
        content = content[:begin] + new + content[end:]
    return content


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every section or list in `value` with every key or index of it."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    return [(value, key) for key in keys] + [place for key in keys for place in _places(value[key])]


@st.composite
def _scenarios(draw: Draw) -> bytes:
    text = draw(st.sampled_from(_SCENARIOS)).read_bytes()
    if draw(st.booleans()):
        return _damaged_bytes(draw, text)
    content = YAML(typ="safe", pure=True).load(text)
    for _ in range(draw(st.integers(1, 3))):
        owner, key = draw(st.sampled_from(_places(content)))
        how = draw(st.sampled_from(["replace", "remove", "rename", "add"]))
        if how == "replace":
            owner[key] = draw(_VALUES)
        elif how == "add" and isinstance(owner, dict):
            owner[draw(_TEXTS)] = draw(_VALUES)
        elif how == "rename" and isinstance(owner, dict):
            owner[draw(_TEXTS)] = owner.pop(key)
        else:
            del owner[key]
        if not _places(content):
            break
    # Any JSON is YAML; a digit limit of Python's own stands in the way of the longest numbers.
    return re.sub(r'"(9{30,})"', r"\1", json.dumps(_writable(content))).encode()


def _writable(value: Any) -> Any:
    if isinstance(value, dict):
        return {key if isinstance(key, str) else str(key)[:100]: _writable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_writable(item) for item in value]
    return "9" * 400 if isinstance(value, int) and abs(value) > 10**100 else value


def _check_scenario(folder: Path, content: bytes) -> None:
    path = folder / "scene.yaml"
    path.write_bytes(content)
    with _sound_or_refused(path):
        scenario = load_scenario(path)
        # What was read can be written down, and read again as the same.
        path.write_text(json.dumps(scenario.resolved()))
        assert load_scenario(path) == scenario


@st.composite
def _documents(draw: Draw, content: bytes) -> bytes:
    """An XML document with some attributes, elements or bytes changed."""
    if draw(st.integers(0, 3)) == 0:
        return _damaged_bytes(draw, content)
    root = etree.fromstring(content)
    for _ in range(draw(st.integers(1, 3))):
        element = draw(st.sampled_from([item for item in root.iter() if isinstance(item.tag, str)]))
        how = draw(st.sampled_from(["attribute", "attribute", "attribute", "drop", "remove", "double", "text", "tag"]))
        parent = element.getparent()
        if how in ("attribute", "drop") and element.attrib:
            name = draw(st.sampled_from(sorted(element.attrib)))
            if how == "drop":
                del element.attrib[name]
            else:
                element.set(name, _legal(draw(_TEXTS)))
        elif how == "remove" and parent is not None:
            parent.remove(element)
        elif how == "double" and parent is not None:
            parent.append(etree.fromstring(etree.tostring(element)))
        elif how == "text":
            element.text = _legal(draw(_TEXTS))
        elif how == "tag" and parent is not None:
            element.tag = draw(st.sampled_from([item.tag for item in root.iter() if isinstance(item.tag, str)]))
    prolog = draw(st.sampled_from([b"", b"", b"", b'<!DOCTYPE a [<!ENTITY b "c">]>']))
    return prolog + etree.tostring(root)


def _legal(text: str) -> str:
    return "".join(letter for letter in text if letter.isprintable())


def _repacked(source: Path, path: Path, changed: dict[str, bytes]) -> None:
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, changed.get(name, old.read(name)))


@st.composite
def _archives(draw: Draw, sound: Path, folder: Path, documents: list[str]) -> Path:
    """The archive `sound` with bytes of it, or one of its `documents`, changed."""
    path = folder / f"mutant{sound.suffix}"
    if draw(st.integers(0, 2)) == 0:
        path.write_bytes(_damaged_bytes(draw, sound.read_bytes()))
        return path
    name = draw(st.sampled_from(documents))
    with zipfile.ZipFile(sound) as archive:
        content = archive.read(name)
    _repacked(sound, path, {name: draw(_documents(content))})
    return path


def _check_fmu(path: Path) -> None:
    folder = path.parent / "unpacked"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    with _sound_or_refused(path):
        file = FmuFile(path)
        description = read_description(file)
        fields(description, groups(description.modelVariables, ("input", "output")), {})
        file.unpack(folder)


def _check_package(path: Path) -> None:
    with _sound_or_refused(path), open_package(path, (), lambda text: None) as (scenario, _):
        json.dumps(scenario.resolved())


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small FMU of ours, without the code in it, which is not read here."""
    folder = tmp_path_factory.mktemp("fmu")
    whole = build_fmu(ActiveStress, build("cell", 5.0), folder / "whole.fmu")
    path = folder / "small.fmu"
    with zipfile.ZipFile(whole) as old, zipfile.ZipFile(path, "w") as new:
        for name in ("modelDescription.xml", *(name for name in old.namelist() if name.startswith("binaries"))):
            new.writestr(name, old.read(name)[:20_000])
    return path


@pytest.fixture(scope="module", params=[2, 3])
def package(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A package of ours, of SSP 1.0 or 2.0, whose FMUs have descriptions only."""
    folder = tmp_path_factory.mktemp("package")
    path = next(path for path in _SCENARIOS if path.stem == "cell")
    scenario = load_scenario(path)
    whole = write_package(build_fmus(scenario, path.parent, folder / "built", fmi=request.param))
    small: dict[str, bytes] = {}
    with zipfile.ZipFile(whole) as archive:
        for name in archive.namelist():
            if name.endswith(".fmu"):
                inner = folder / "inner.fmu"
                inner.write_bytes(archive.read(name))
                with zipfile.ZipFile(inner) as old:
                    description = old.read("modelDescription.xml")
                with zipfile.ZipFile(folder / "small.fmu", "w") as new:
                    new.writestr("modelDescription.xml", description)
                small[name] = (folder / "small.fmu").read_bytes()
    _repacked(whole, folder / "small.ssp", small)
    return folder / "small.ssp"


def _scenarios_are_sound_or_refused(folder: Path, examples: int) -> None:
    _few(examples)(given(_scenarios())(lambda content: _check_scenario(folder, content)))()


def _fmus_are_sound_or_refused(fmu: Path, folder: Path, examples: int) -> None:
    _few(examples)(given(_archives(fmu, folder, ["modelDescription.xml"]))(_check_fmu))()


def _packages_are_sound_or_refused(package: Path, folder: Path, examples: int) -> None:
    with zipfile.ZipFile(package) as archive:
        documents = [name for name in archive.namelist() if name.endswith((".ssd", ".ssv"))]
    _few(examples)(given(_archives(package, folder, documents))(_check_package))()


def test_damaged_scenarios(tmp_path: Path) -> None:
    """A slip of the pen in a scenario could end in a traceback."""
    _scenarios_are_sound_or_refused(tmp_path, 120)


def test_damaged_fmus(fmu: Path, tmp_path: Path) -> None:
    """An FMU of a tool with a bug of its own could end in a traceback."""
    _check_fmu(fmu)
    _fmus_are_sound_or_refused(fmu, tmp_path, 120)


def test_damaged_packages(package: Path, tmp_path: Path) -> None:
    """A package that somebody edited could end in a traceback."""
    _check_package(package)
    _packages_are_sound_or_refused(package, tmp_path, 40)


@pytest.mark.long
def test_thousands_of_damaged_scenarios(tmp_path: Path) -> None:
    """As above, by the thousands."""
    _scenarios_are_sound_or_refused(tmp_path, 3000)


@pytest.mark.long
def test_thousands_of_damaged_fmus(fmu: Path, tmp_path: Path) -> None:
    """As above, by the thousands."""
    _fmus_are_sound_or_refused(fmu, tmp_path, 1500)


@pytest.mark.long
def test_thousands_of_damaged_packages(package: Path, tmp_path: Path) -> None:
    """As above, by the thousands."""
    _packages_are_sound_or_refused(package, tmp_path, 1500)
