"""If these fail, a person who mistypes something gets a traceback, the wrong exit code in their script, or loses the
results of yesterday."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from cardiac_cosim.units.mesh.file import write_mesh
from fallbacks import without_fallbacks

Cosim = Callable[..., Any]

_COMMAND = [sys.executable, "-m", "cardiac_cosim.cli"]


def _wrong(ended: Any, *words: str) -> None:
    """Exit code 2 and one line on stderr, with these words."""
    assert ended.code == 2, ended
    assert ended.err.startswith("error: ")
    assert ended.err.count("\n") == 1
    assert "Traceback" not in ended.err
    for word in words:
        assert word in ended.err


def _content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def _numbers(folder: Path) -> dict[str, np.ndarray]:
    """Every number in the result files of a folder."""
    found: dict[str, np.ndarray] = {}
    for name in ("timeseries.csv", "coupling.csv"):
        with (folder / name).open(newline="") as file:
            found[name] = np.array([float(cell) for row in list(csv.reader(file))[1:] for cell in row if cell])
    with h5py.File(folder / "fields.h5") as file:
        file.visititems(lambda name, item: found.update({name: item[:]} if isinstance(item, h5py.Dataset) else {}))
    return found


# --- in a process of its own --------------------------------------------------------------------------------------


def _process(*arguments: object, **options: Any) -> Any:
    ended = subprocess.run(
        [*_COMMAND, *map(str, arguments), "--no-figures", "--no-report"],
        capture_output=True,
        text=True,
        timeout=60,
        **options,
    )
    ended.stderr = without_fallbacks(ended.stderr)
    return ended


def test_exit_codes_as_a_shell_sees_them(small_scenario: Path, tmp_path: Path) -> None:
    done = _process(
        "run",
        small_scenario,
        "--output",
        tmp_path / "out",
        "--set",
        "run.stop_ms=2",
        "--set",
        "output={}",
        "--set",
        "output.every_ms=1",
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert f"results in {tmp_path / 'out'}" in done.stdout
    wrong = _process("run", tmp_path / "missing.yaml")
    assert (wrong.returncode, wrong.stdout) == (2, "")
    assert wrong.stderr == f"error: {tmp_path / 'missing.yaml'}: no such scenario file\n"
    failed = _process(
        "run",
        small_scenario,
        "--output",
        tmp_path / "as_printed",
        "--set",
        "units.mechanics.parameters.neo_hooke_log_sign=as_printed",
    )
    assert (failed.returncode, failed.stdout) == (3, "")
    assert failed.stderr.startswith("failed: unit 'mechanics' failed during initialisation")
    assert "Traceback" not in failed.stderr + wrong.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopping_by_hand_leaves_whole_files_and_says_so(number: int, small_scenario: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = subprocess.Popen(
        [*_COMMAND, "run", str(small_scenario), "--output", str(out), "--set", "run.stop_ms=100000"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A test run in the background of a shell ignores SIGINT, and its children would inherit that.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    try:
        begun = time.monotonic()
        while not (out / "coupling.csv").is_file() or (out / "coupling.csv").read_text().count("\n") < 4:
            assert time.monotonic() - begun < 120.0, process.poll()
            time.sleep(0.05)
        process.send_signal(number)
        _, message = process.communicate(timeout=120)
    finally:
        process.kill()
    assert process.returncode == 128 + number
    assert "interrupted" in message
    assert "Traceback" not in message
    assert json.loads((out / "summary.json").read_text())["status"] == "interrupted"
    for name, numbers in _numbers(out).items():
        assert np.isfinite(numbers).all(), name


def test_one_scenario_gives_the_same_bits_in_two_processes(small_scenario: Path, tmp_path: Path) -> None:
    series = []
    for number in range(2):
        folder = tmp_path / str(number)
        done = _process("run", small_scenario, "--output", folder, "--set", "run.stop_ms=5", cwd=tmp_path)
        assert done.returncode == 0
        series.append((folder / "timeseries.csv").read_bytes())
    assert series[0] == series[1]


# --- help ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--help"], ["run", "build"]),
        (["run", "--help"], ["FILE", "--output", "--set", "--participants"]),
        (["build", "--help"], ["FILE", "--output"]),
    ],
)
def test_help_tells_what_there_is(cosim: Cosim, arguments: list[str], words: list[str]) -> None:
    ended = cosim(*arguments)
    assert ended.code == 0
    for word in words:
        assert word in ended.out


@pytest.mark.parametrize(
    "arguments",
    [
        ["rum", "x.yaml"],
        ["run"],
        ["run", "a.yaml", "b.yaml"],
        ["run", "x.yaml", "--outputs", "x"],
        ["run", "x", "--steps", "5"],
    ],
)
def test_a_mistyped_command_ends_with_2(cosim: Cosim, arguments: list[str]) -> None:
    ended = cosim(*arguments)
    assert ended.code == 2
    assert "Usage" in ended.err
    assert "Traceback" not in ended.err


# --- runs that go well --------------------------------------------------------------------------------------------


def test_a_run_reports_where_its_results_are(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ended = cosim("run", small_scenario, "--set", "run.stop_ms=5")
    assert (ended.code, ended.err) == (0, "")
    # The default folder is named after the scenario, below the folder the person is in.
    assert f"results in {Path('results') / 'small'}" in ended.out
    assert {path.name for path in (tmp_path / "results" / "small").iterdir()} >= {
        "timeseries.csv",
        "coupling.csv",
        "fields.h5",
        "fields.xdmf",
        "summary.json",
    }
    assert "small: 5 steps to 5 ms" in ended.out
    assert "activation at apex: none" in ended.out


def test_native_units_and_fmus_write_the_same_bits(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, fmu_dir: Path
) -> None:
    for kind in ("native", "fmu"):
        ended = cosim("run", small_scenario, "--participants", kind, "--output", tmp_path / kind, "--fmu-dir", fmu_dir)
        assert (ended.code, ended.err) == (0, "")
        assert json.loads((tmp_path / kind / "summary.json").read_text())["scenario"]["run"]["participants"] == kind
    native, fmu = _numbers(tmp_path / "native"), _numbers(tmp_path / "fmu")
    native.pop("coupling.csv")
    assert native.keys() == fmu.keys() - {"coupling.csv"}
    for name, numbers in native.items():
        assert (numbers == fmu[name]).all(), name


def test_running_twice_into_one_folder_leaves_the_second_run_only(
    cosim: Cosim, small_scenario: Path, tmp_path: Path
) -> None:
    for stop, changed in ((10, "[]"), (5, "[]")):
        ended = cosim(
            "run",
            small_scenario,
            "--output",
            tmp_path / "out",
            "--set",
            f"run.stop_ms={stop}",
            "--set",
            f"connections={changed}",
        )
        assert ended.code == 0
    with (tmp_path / "out" / "timeseries.csv").open(newline="") as file:
        assert [float(row[0]) for row in list(csv.reader(file))[1:]] == [0, 1, 2, 3, 4, 5]
    with h5py.File(tmp_path / "out" / "fields.h5") as file:
        assert file["frames_ms"][:].tolist() == [0.0, 5.0]
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["steps"] == 5


def test_names_with_spaces_and_umlauts_in_paths(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mein Übungs [herz]"
    folder.mkdir()
    scenario = small_scenario.rename(folder / "schön & gut.yaml")
    ended = cosim("run", scenario, "--output", folder / "out put", "--set", "run.stop_ms=5", "--set", "name=Herz-ü")
    assert (ended.code, ended.err) == (0, "")
    assert (folder / "out put" / "summary.json").is_file()


# --- wrong input --------------------------------------------------------------------------------------------------

_P = "units.mechanics.parameters."
_SETS: dict[str, tuple[list[str], list[str]]] = {
    "unknown section": (["runn.stop_ms=3"], ["unknown key 'runn'", "did you mean 'run'?"]),
    "number with its unit": (["run.stop_ms=10 ms"], ["'run.stop_ms' is '10 ms'", "expected a number"]),
    "no equals sign": (["run.stop_ms"], ["--set run.stop_ms", "key.path=value"]),
    "unknown unit": (["units.x.unit=mechanic"], ["units.x", "unknown unit 'mechanic'", "did you mean 'mechanics'?"]),
    "unknown parameter": ([_P + "shear_modulus=1"], ["units.mechanics", "'shear_modulus'", "did you mean 'shear_mod"]),
    "negative modulus": ([_P + "shear_modulus_MPa=-1"], ["units.mechanics", "'shear_modulus_MPa' is -1", "> 0"]),
    "infinite modulus": ([_P + "shear_modulus_MPa=.inf"], ["units.mechanics", "shear_modulus_MPa", "finite"]),
    "endless modulus": ([_P + "shear_modulus_MPa=" + "9" * 400], ["shear_modulus_MPa", "finite"]),
    "text for a modulus": ([_P + "shear_modulus_MPa=stiff"], ["'shear_modulus_MPa' is 'stiff'", "number"]),
    "true for a modulus": ([_P + "shear_modulus_MPa=true"], ["'shear_modulus_MPa' is True", "number"]),
    "unknown choice": ([_P + "neo_hooke_log_sign=seed"], ["'neo_hooke_log_sign' is 'seed'", "as_printed"]),
    "number as choice": ([_P + "neo_hooke_log_sign=1"], ["'neo_hooke_log_sign' is 1", "choose one of"]),
    "negative rate": (["units.active_stress.parameters.slow_rate_per_ms=-0.1"], ["units.active_stress", "> 0"]),
    "connection to nowhere": (["connections=[mechanics.strech -> active_stress.stretch]"], ["did you mean 'stretch'?"]),
    "connection of nobody": (["connections=[muscle.x -> mechanics.fiber]"], ["connections", "unknown unit 'muscle'"]),
    "connection of two shapes": (
        ["connections=[mechanics.lv_volume -> active_stress.potential]"],
        ["mechanics.lv_volume -> active_stress.potential", "shapes differ, () -> (271,)"],
    ),
    "connection of two units of measure": (
        ["connections=[active_stress.active_stress -> active_stress.potential]"],
        ["units of measure differ, kPa -> mV"],
    ),
    "order without mechanics": (["coupling.order=[electrophysiology, active_stress]"], ["coupling.order: mechanics"]),
    "order of unknown units": (["coupling.order=[heart]"], ["coupling.order", "unknown unit 'heart'"]),
    "probe on the moon": (["output.probes_mm.moon=[0, 0, 9999]"], ["output.probes_mm.moon", "nearest node"]),
    "mesh that is not there": (["scene.mesh=nowhere.msh"], ["scene", "nowhere.msh: no such mesh file"]),
    "mesh that is a folder": (["scene.mesh=."], ["scene", "no such mesh file"]),
    "mesh without a name": (["scene.mesh=''"], ["scene", "no such mesh file"]),
    "mesh that is a scenario": (["scene.mesh=small.yaml"], ["scene", "small.yaml: meshio cannot read it"]),
    "unknown geometry": (["scene={geometry: biventricel}"], ["scene", "biventricel", "did you mean 'biventricle'?"]),
    "geometry in too large steps": (["scene={geometry: biventricle, mesh_size_mm: 1e5}"], ["scene", "mm"]),
    "geometry in too small steps": (["scene={geometry: biventricle, mesh_size_mm: 1e-5}"], ["scene", "mm"]),
    "FMU that is not there": (["units.extra={fmu: nowhere.fmu}"], ["unit 'extra'", "nowhere.fmu: no such FMU"]),
    "FMU without a name": (["units.extra={fmu: ''}"], ["unit 'extra'", "this folder has no modelDescription.xml"]),
    "FMU that is a scenario": (["units.extra={fmu: small.yaml}"], ["unit 'extra'", "small.yaml", "not a zip archive"]),
}


@pytest.mark.parametrize("participants", ["native", "fmu"])
@pytest.mark.parametrize(("assignments", "words"), _SETS.values(), ids=_SETS)
def test_wrong_input_ends_with_2_and_leaves_yesterdays_results_alone(
    cosim: Cosim,
    small_scenario: Path,
    tmp_path: Path,
    fmu_dir: Path,
    participants: str,
    assignments: list[str],
    words: list[str],
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    for name in ("timeseries.csv", "fields.h5", "summary.json", "coupling.csv", "fields.xdmf"):
        (folder / name).write_text("yesterday")
    yesterday = _content(folder)
    sets = [item for text in assignments for item in ("--set", text)]
    ended = cosim(
        "run", small_scenario, "--output", folder, "--participants", participants, "--fmu-dir", fmu_dir, *sets
    )
    _wrong(ended, *words)
    assert len(ended.err) < 1000 + len("".join(assignments))
    assert _content(folder) == yesterday


@pytest.mark.parametrize("participants", ["native", "fmu"])
@pytest.mark.parametrize("missing", ["base", "lv_endocardium", "rv_endocardium", "rv_septum", "epicardium"])
def test_a_mesh_without_a_boundary_ends_with_2_and_leaves_yesterdays_results_alone(
    cosim: Cosim, small_scenario: Path, small_heart, tmp_path: Path, fmu_dir: Path, missing: str, participants: str
) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "timeseries.csv").write_text("yesterday")
    (folder / "summary.json").write_text("yesterday")
    yesterday = _content(folder)
    kept = {name: faces for name, faces in small_heart.boundaries.items() if name != missing}
    write_mesh(type(small_heart)(small_heart.points, small_heart.cells, kept), tmp_path / "part.msh")
    ended = cosim(
        "run",
        small_scenario,
        "--set",
        "scene.mesh=part.msh",
        "--output",
        folder,
        "--participants",
        participants,
        "--fmu-dir",
        fmu_dir,
    )
    _wrong(ended, str(small_scenario), f"no boundary named '{missing}'", "physical group")
    assert _content(folder) == yesterday


def _mesh_file(path: Path, points: np.ndarray, cells: np.ndarray, boundaries: dict[str, np.ndarray]) -> None:
    class Raw:
        elements = len(cells)

    raw = Raw()
    raw.points, raw.cells, raw.boundaries = points, cells, boundaries  # type: ignore[attr-defined]
    write_mesh(raw, path)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        ("inverted", ["element", "inverted", "reorder its nodes"]),
        ("in two pieces", ["falls into 2 pieces", "fuse"]),
        ("flat", ["element", "inverted or flat"]),
        ("a node nowhere", ["coordinate that is not finite"]),
    ],
)
def test_a_damaged_mesh_is_refused_with_the_place_of_the_damage(
    cosim: Cosim, small_scenario: Path, small_heart, tmp_path: Path, damage: str, words: list[str]
) -> None:
    points, cells, boundaries = small_heart.points.copy(), small_heart.cells.copy(), dict(small_heart.boundaries)
    if damage == "inverted":
        cells[7] = cells[7][[1, 0, 2, 3]]
    elif damage == "in two pieces":
        cells = np.concatenate([cells, cells + len(points)])
        points = np.concatenate([points, points + 500.0])
    elif damage == "flat":
        points[cells[7, 0]] = points[cells[7, 1]]
    else:
        points[3] = np.nan
    _mesh_file(tmp_path / "bad.msh", points, cells, boundaries)
    ended = cosim("run", small_scenario, "--set", "scene.mesh=bad.msh", "--output", tmp_path / "out")
    _wrong(ended, str(small_scenario), "scene", "bad.msh", *words)
    assert not (tmp_path / "out" / "timeseries.csv").exists()


@pytest.mark.parametrize("value", ["fmus", "NATIVE", "1", "{}"])
def test_participants_of_no_kind(cosim: Cosim, small_scenario: Path, tmp_path: Path, value: str) -> None:
    ended = cosim("run", small_scenario, "--participants", value, "--output", tmp_path / "out")
    _wrong(ended, "participants", value.strip("{}"), "'fmu', 'fmu3' or 'native'")
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("place", ["file", "file/below", "long"])
def test_an_output_folder_that_cannot_be(cosim: Cosim, small_scenario: Path, tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("precious")
    folder = tmp_path / ("x" * 300 if place == "long" else place)
    _wrong(cosim("run", small_scenario, "--output", folder), str(small_scenario), str(folder), "--output")
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="nothing is forbidden to root")
def test_an_output_folder_that_is_read_only(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.mkdir(mode=0o500)
    _wrong(cosim("run", small_scenario, "--output", folder), str(folder), "--output")


@pytest.mark.parametrize("name", ["timeseries.csv", "coupling.csv", "fields.h5", "fields.xdmf", "summary.json"])
def test_a_folder_where_a_results_file_should_go(cosim: Cosim, small_scenario: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "out" / name).mkdir(parents=True)
    _wrong(cosim("run", small_scenario, "--output", tmp_path / "out", "--set", "run.stop_ms=5"), name, "--output")


def test_a_place_for_fmus_that_is_none(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    ended = cosim(
        "run", small_scenario, "--participants", "fmu", "--fmu-dir", tmp_path / "file", "--output", tmp_path / "out"
    )
    _wrong(ended, str(tmp_path / "file"), "--fmu-dir")


# --- foreign and broken FMUs --------------------------------------------------------------------------------------


@pytest.fixture
def built(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "built"
    assert cosim("build", small_scenario, "--output", folder).code == 0
    return folder


def test_build_writes_one_fmu_per_unit_that_runs_as_a_participant(
    cosim: Cosim, small_scenario: Path, built: Path, tmp_path: Path
) -> None:
    assert sorted(path.name for path in built.iterdir()) == [
        "active_stress.fmu",
        "electrophysiology.fmu",
        "fiber_generator.fmu",
        "mechanics.fmu",
    ]
    for path in built.iterdir():
        with zipfile.ZipFile(path) as archive:
            assert "modelDescription.xml" in archive.namelist()
    swapped = {"unit": None, "fmu": str(built / "mechanics.fmu")}
    for folder, more in (("fmu", ["--set", f"units.mechanics={json.dumps(swapped)}"]), ("native", [])):
        assert cosim("run", small_scenario, "--output", tmp_path / folder, *more).code == 0
    assert (tmp_path / "fmu" / "timeseries.csv").read_bytes() == (tmp_path / "native" / "timeseries.csv").read_bytes()


def test_build_writes_one_fmu_for_two_units_of_a_kind(cosim: Cosim, small_scenario: Path, tmp_path: Path) -> None:
    ended = cosim(
        "build",
        small_scenario,
        "--output",
        tmp_path / "b",
        "--set",
        "units={a: {unit: mechanics}, b: {unit: mechanics}}",
    )
    assert ended.code == 0
    assert [path.name for path in (tmp_path / "b").iterdir()] == ["mechanics.fmu"]
    assert ended.out.split() == [str(tmp_path / "b" / "mechanics.fmu")]


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ("{shear_modulus: 1}", ["unit 'mechanics'", "no parameter 'shear_modulus'", "did you mean"]),
        ("{shear_modulus_MPa: stiff}", ["unit 'mechanics'", "'shear_modulus_MPa'", "'stiff'"]),
        ("{shear_modulus_MPa: -1}", ["unit 'mechanics'", "'shear_modulus_MPa'", "> 0"]),
        ("{neo_hooke_log_sign: 5}", ["unit 'mechanics'", "'neo_hooke_log_sign'", "5"]),
        ("{neo_hooke_log_sign: seeed}", ["unit 'mechanics'", "'neo_hooke_log_sign'", "seeed"]),
    ],
)
def test_a_wrong_parameter_of_an_fmu(
    cosim: Cosim, small_scenario: Path, built: Path, tmp_path: Path, parameters: str, words: list[str]
) -> None:
    text = f"units.mechanics={{fmu: '{built / 'mechanics.fmu'}', parameters: {parameters}}}"
    _wrong(cosim("run", small_scenario, "--output", tmp_path / "out", "--set", text), str(small_scenario), *words)


def test_a_text_where_an_fmu_wants_the_number_that_makes_an_input_matter(
    cosim: Cosim, small_scenario: Path, built: Path, tmp_path: Path
) -> None:
    text = f"units.active_stress={{fmu: '{built / 'active_stress.fmu'}', parameters: {{length_dependence: much}}}}"
    ended = cosim("run", small_scenario, "--output", tmp_path / "out", "--set", text)
    _wrong(ended, "unit 'active_stress'", "'length_dependence'", "'much'")


def test_an_fmu_of_another_mesh_does_not_fit(
    cosim: Cosim, small_scenario: Path, small_heart, built: Path, tmp_path: Path
) -> None:
    keep = np.ones(small_heart.elements, dtype=bool)
    # Without one inner element the mesh is another one; the nodes all remain.
    corner = next(
        number
        for number in range(small_heart.elements)
        if np.isin(small_heart.cells[number], np.delete(small_heart.cells, number, 0)).all()
        and len(np.unique(np.delete(small_heart.cells, number, 0))) == small_heart.nodes
        and not any(
            set(face) <= set(small_heart.cells[number].tolist())
            for faces in small_heart.boundaries.values()
            for face in faces.tolist()
        )
    )
    keep[corner] = False
    hole = small_heart.cells[corner][[[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]]
    boundaries = dict(small_heart.boundaries) | {"epicardium": np.vstack([small_heart.boundary("epicardium"), hole])}
    write_mesh(type(small_heart)(small_heart.points, small_heart.cells[keep], boundaries), tmp_path / "o.msh")
    ended = cosim(
        "run",
        small_scenario,
        "--output",
        tmp_path / "out",
        "--set",
        "scene.mesh=o.msh",
        "--set",
        f"units.mechanics={{fmu: '{built / 'mechanics.fmu'}'}}",
    )
    _wrong(ended, "connections", "shapes differ", "same mesh")


@pytest.mark.parametrize(
    ("description", "words"),
    [
        (None, ["broken.fmu", "has no modelDescription.xml"]),
        ("", ["broken.fmu", "not well-formed XML"]),
        ("<not xml", ["broken.fmu", "not well-formed XML"]),
        (
            '<fmiModelDescription fmiVersion="1.0" modelName="a" modelIdentifier="a" guid="x" '
            'numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables/><Implementation>'
            "<CoSimulation_StandAlone><Capabilities/></CoSimulation_StandAlone></Implementation></fmiModelDescription>",
            ["broken.fmu", "an FMU of FMI 1.0, which is not supported"],
        ),
        (
            '<fmiModelDescription fmiVersion="3.0" modelName="a" instantiationToken="x">'
            '<ModelExchange modelIdentifier="a"/><ModelVariables/><ModelStructure/></fmiModelDescription>',
            ["broken.fmu", "an FMU for model exchange only"],
        ),
        (
            '<fmiModelDescription fmiVersion="3.0" modelName="a" instantiationToken="x">'
            '<CoSimulation modelIdentifier="a"/><ModelVariables/><ModelStructure/></fmiModelDescription>',
            ["extra", "no library for this platform"],
        ),
        ('<fmiModelDescription fmiVersion="2.0" modelName="a" guid="x"/>', ["broken.fmu"]),
        (
            '<fmiModelDescription fmiVersion="2.0" modelName="a" guid="x"><CoSimulation modelIdentifier="a"/>'
            "<ModelVariables/><ModelStructure/></fmiModelDescription>",
            ["extra", "no library for this platform"],
        ),
    ],
    ids=[
        "no description",
        "empty",
        "no xml",
        "FMI 1",
        "FMI 3 for model exchange",
        "FMI 3 without binary",
        "no co-simulation",
        "no binary",
    ],
)
def test_a_broken_fmu(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, description: str | None, words: list[str]
) -> None:
    with zipfile.ZipFile(tmp_path / "broken.fmu", "w") as archive:
        archive.writestr("readme.txt", "hello")
        if description is not None:
            archive.writestr("modelDescription.xml", description)
    ended = cosim("run", small_scenario, "--output", tmp_path / "out", "--set", "units.extra={fmu: broken.fmu}")
    _wrong(ended, str(small_scenario), *words)


@pytest.mark.parametrize("place", ["file", "file/below"])
def test_build_into_a_folder_that_cannot_be(cosim: Cosim, small_scenario: Path, tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("precious")
    _wrong(cosim("build", small_scenario, "--output", tmp_path / place), str(tmp_path / place), "--output")
    assert (tmp_path / "file").read_text() == "precious"


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("scene.mesh=nowhere.msh", ["scene", "nowhere.msh"]),
        ("units.mechanics.unit=mechanic", ["mechanics", "unknown unit 'mechanic'"]),
        ("units.mechanics.parameters.shear=1", ["mechanics", "'shear'"]),
    ],
)
def test_build_of_wrong_input_builds_nothing(
    cosim: Cosim, small_scenario: Path, tmp_path: Path, assignment: str, words: list[str]
) -> None:
    ended = cosim("build", small_scenario, "--output", tmp_path / "built", "--set", assignment)
    _wrong(ended, str(small_scenario), *words)
    assert not (tmp_path / "built").exists()


# --- the physics fails --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("participants", ["native", "fmu"])
@pytest.mark.parametrize(
    ("parameter", "words", "steps"),
    [
        (
            "mechanics.parameters.neo_hooke_log_sign",
            ["unit 'mechanics'", "initialisation", "no stress-free state", "neo_hooke_log_sign: stress_free"],
            0,
        ),
        (
            "active_stress.parameters.delay_function",
            ["unit 'active_stress'", "in the step from", "delay_function: gompertz", "ms are complete"],
            1,
        ),
    ],
)
def test_the_seeds_two_slips_end_with_3_and_no_nan_anywhere(
    cosim: Cosim,
    small_scenario: Path,
    tmp_path: Path,
    fmu_dir: Path,
    participants: str,
    parameter: str,
    words: list[str],
    steps: int,
) -> None:
    folder = tmp_path / "out"
    # What an earlier run left there must not pass for this one's.
    assert cosim("run", small_scenario, "--output", folder, "--set", "run.stop_ms=5").code == 0
    ended = cosim(
        "run",
        small_scenario,
        "--output",
        folder,
        "--participants",
        participants,
        "--fmu-dir",
        fmu_dir,
        "--set",
        f"units.{parameter}=as_printed",
    )
    assert ended.code == 3
    assert ended.err.startswith("failed: ")
    assert ended.err.count("\n") == 1
    assert "Traceback" not in ended.err
    for word in words:
        assert word in ended.err
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["status"] == "failed"
    assert summary["message"] in ended.err
    assert summary["steps"] == steps
    for name, numbers in _numbers(folder).items():
        assert np.isfinite(numbers).all(), name
    with (folder / "timeseries.csv").open(newline="") as file:
        assert len(list(csv.reader(file))) == (1 + steps + 1 if steps else 1)
