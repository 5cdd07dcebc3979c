"""If these fail, a slip in a scenario file runs the wrong heart, or ends in a message that helps nobody."""

from pathlib import Path

import pytest
from cardiac_cosim.orchestrator.coupling.timeline import Timeline
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.scenario import Scenario, load_scenario, scenario_content, with_settings

FULL = """\
name: baseline
scene:
  geometry: biventricle          # a comment
  mesh_size_mm: 5
units:
  fibers:            {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {stimulus_depth_mm: 2}}
  active_stress:     {unit: active_stress}
  mechanics:         {unit: mechanics}
connections:
  - electrophysiology.potential -> active_stress.potential
coupling:
  scheme: gauss-seidel
  order: [electrophysiology, active_stress, mechanics]
  step_ms: 1
  iterate: null
  interpolation: hold
  extrapolation: 0
run: {stop_ms: 320, participants: fmu}
output:
  every_ms: 5
  probes_mm: {base: [25, 0, -1], middle: [20, 0, -40], apex: [0, 0, -60]}
"""

SMALL = """\
name: small
scene: {mesh: heart.msh}
units:
  fibers: {unit: fiber_generator}
  mechanics: {unit: mechanics}
coupling: {scheme: gauss-seidel, step_ms: 1}
run: {stop_ms: 10, participants: native}
output: {every_ms: 5, probes_mm: {base: [25, 0, -1]}}
"""


def _load(folder: Path, content: str | bytes, *assignments: str) -> Scenario:
    path = folder / "scene.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_scenario(path, assignments)


def _changed(old: str, new: str) -> str:
    assert SMALL.count(old) == 1, old
    return SMALL.replace(old, new)


def test_the_example_of_the_contract_loads_with_every_value_where_it_belongs(tmp_path: Path) -> None:
    scenario = _load(tmp_path, FULL)
    assert scenario.name == "baseline"
    assert (scenario.scene.geometry, scenario.scene.mesh, scenario.scene.mesh_size_mm) == ("biventricle", None, 5.0)
    assert list(scenario.units) == ["fibers", "electrophysiology", "active_stress", "mechanics"]
    assert scenario.units["electrophysiology"].unit == "electrophysiology"
    assert scenario.units["electrophysiology"].parameters == {"stimulus_depth_mm": 2}
    assert scenario.connections == ["electrophysiology.potential -> active_stress.potential"]
    assert scenario.coupling.order == ["electrophysiology", "active_stress", "mechanics"]
    assert (scenario.coupling.iterate, scenario.coupling.interpolation, scenario.coupling.extrapolation) == (
        None,
        "hold",
        0,
    )
    assert (scenario.run.stop_ms, scenario.run.participants) == (320.0, "fmu")
    assert scenario.output.probes_mm == {"base": [25, 0, -1], "middle": [20, 0, -40], "apex": [0, 0, -60]}


def test_what_is_left_out_has_the_values_of_the_contract(tmp_path: Path) -> None:
    scenario = _load(tmp_path, "name: a\nscene: {geometry: biventricle}\nunits: {m: {unit: mechanics}}\n")
    assert scenario.scene.mesh_size_mm == 5.0
    assert scenario.connections == []
    assert (scenario.coupling.scheme, scenario.coupling.order, scenario.coupling.step_ms) == ("gauss-seidel", None, 1.0)
    assert (scenario.run.stop_ms, scenario.run.participants) == (320.0, "fmu")
    assert (scenario.output.every_ms, scenario.output.probes_mm) == (5.0, {})
    assert scenario.units["m"].parameters == {}


@pytest.mark.parametrize(
    ("step", "steps"), [("1e-1", 100), ("0.1", 100), ("0.3", None), ("1E0", 10), ("2.5", 4), ("&anchor 1", 10)]
)
def test_steps_are_counted_in_whole_numbers_whatever_way_they_are_written(
    tmp_path: Path, step: str, steps: int | None
) -> None:
    text = _changed("step_ms: 1", f"step_ms: {step}")
    if steps is None:
        with pytest.raises(InputError, match=r"run\.stop_ms"):
            _load(tmp_path, text)
    else:
        scenario = _load(tmp_path, text)
        time = Timeline.of_fixed_step(scenario.coupling.step_ms, scenario.run.stop_ms, scenario.output.every_ms)
        assert time.stop == steps


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_names_in_any_script_and_windows_line_ends_are_read(tmp_path: Path, encoding: str) -> None:
    text = _changed("name: small", "name: Herz-ü").replace("base:", "Spitze_ä:").replace("\n", "\r\n")
    scenario = _load(tmp_path, text.encode(encoding))
    assert scenario.name == "Herz-ü"
    assert list(scenario.output.probes_mm) == ["Spitze_ä"]


# Each: what a person did, what the text holds then, and the words the message must have.
_NO_NUMBER = ["expected a number", "alone"]
_NO_SECTION = ["expected a section", "key: value"]
_WRONG: dict[str, tuple[str | bytes, list[str]]] = {
    # not YAML
    "tab": (_changed("  mechanics", "\tmechanics"), ["line 5", "spaces, not with tabs"]),
    "section twice": (SMALL + "run: {stop_ms: 3}\n", ["line 9", '"run"', "keep one"]),
    "key twice": (_changed("stop_ms: 10", "stop_ms: 10, stop_ms: 20"), ["line 7", '"stop_ms"', "keep one"]),
    "no colon": (_changed("name: small", "name small"), ["line 2", "colon"]),
    "no space after colon": (_changed("name: small", "name:small"), ["line 2", "space follows every colon"]),
    "brace not closed": (_changed("native}", "native"), ["line 8", "close the bracket or brace"]),
    "quote not closed": (_changed("name: small", "name: 'small"), ["not valid YAML", "quote"]),
    "at sign": (_changed("name: small", "name: @small"), ["line 1", "quotes"]),
    "star": (_changed("name: small", "name: *small"), ["line 1", "'small'", "quotes"]),
    "exclamation mark": (_changed("name: small", "name: !small"), ["line 1", "quotes"]),
    "python object": (_changed("name: small", "name: !!python/object:os.system {}"), ["line 1", "not valid YAML"]),
    "two documents": (SMALL + "---\n" + SMALL, ["line 9", "---"]),
    "no such date": (_changed("name: small", "name: 2020-13-45"), ["not valid YAML", "month", "quotes"]),
    "tag that does not fit": (_changed("step_ms: 1", "step_ms: !!float abc"), ["not valid YAML", "abc"]),
    "tag of nothing": (_changed("step_ms: 1", "step_ms: !!int ''"), ["not valid YAML"]),
    "bracket after bracket": ("a: " + "[" * 600, ["nested too deeply"]),
    "5000 digits": (_changed("step_ms: 1", f"step_ms: {'1' * 5000}"), ["not valid YAML", "5000 digits"]),
    # no scenario
    "empty file": ("", ["empty", "`name`, `scene` and `units`"]),
    "comments only": ("# nothing\n", ["empty", "`name`, `scene` and `units`"]),
    "list": ("- a\n- b\n", ["key: value", "name, scene, units"]),
    "text": ("hello\n", ["key: value", "name, scene, units"]),
    "number": ("5\n", ["key: value", "name, scene, units"]),
    "binary file": (bytes(range(256)), ["not a text file", "UTF-8"]),
    "zip archive": (b"PK\x03\x04" + bytes(50), ["not a text file", "UTF-8"]),
    "latin-1": (_changed("name: small", "name: Herz_ü").encode("latin-1"), ["not a text file", "UTF-8"]),
    # keys
    "misspelt section": (SMALL + "connectons: []\n", ["unknown key 'connectons'", "did you mean 'connections'?"]),
    "misspelt key": (_changed("mesh:", "msh:"), ["unknown key 'scene.msh'", "did you mean 'mesh'?"]),
    "misspelt key of a unit": (
        _changed("{unit: mechanics}", "{unt: mechanics}"),
        ["unknown key 'units.mechanics.unt'", "did you mean 'unit'?"],
    ),
    "unknown key": (SMALL + "zzz: 1\n", ["unknown key 'zzz'", "(known: connect_by_name, connections, coupling"]),
    "key with another unit of measure": (
        _changed("step_ms: 1", "step_s: 0.001"),
        ["unknown key 'coupling.step_s'", "did you mean 'step_ms'?"],
    ),
    "number as key": (SMALL + "5: a\n", ["'5'", "quotes"]),
    "decimal comma": (_changed("step_ms: 1", "step_ms: 1,5"), ["'coupling.5'", "with a point"]),
    "name missing": (_changed("name: small\n", ""), ["the key 'name' is missing"]),
    "scene missing": (_changed("scene: {mesh: heart.msh}\n", ""), ["the key 'scene' is missing"]),
    # sections
    "list for a section": (_changed("{scheme: gauss-seidel, step_ms: 1}", "[jacobi]"), ["'coupling'", *_NO_SECTION]),
    "text for a section": (_changed("{mesh: heart.msh}", "heart.msh"), ["'scene' is 'heart.msh'", *_NO_SECTION]),
    "set for a section": (_changed("{mesh: heart.msh}", "!!set {mesh}"), ["'scene'", *_NO_SECTION]),
    "empty section": (
        _changed(" {scheme: gauss-seidel, step_ms: 1}", ""),
        ["'coupling' is empty", "fill it or remove the key"],
    ),
    "no units": ("name: a\nscene: {mesh: a}\nunits: {}\n", ["'units'", "fill it"]),
    "empty units": ("name: a\nscene: {mesh: a}\nunits:\n", ["'units' is empty", "fill it"]),
    "list of units": ("name: a\nscene: {mesh: a}\nunits:\n  - unit: mechanics\n", ["'units'", *_NO_SECTION]),
    "name for a unit": (_changed("{unit: mechanics}", "mechanics"), ["'units.mechanics'", *_NO_SECTION]),
    "unit and fmu": (_changed("{unit: mechanics}", "{unit: mechanics, fmu: a.fmu}"), ["'units.mechanics'", "either"]),
    "neither unit nor fmu": (_changed("{unit: mechanics}", "{}"), ["'units.mechanics'", "either `unit`"]),
    "geometry and mesh": (_changed("{mesh: heart.msh}", "{mesh: a, geometry: b}"), ["'scene'", "either `geometry`"]),
    "neither geometry nor mesh": (_changed("{mesh: heart.msh}", "{}"), ["'scene'", "either `geometry`"]),
    "size of a mesh file": (
        _changed("{mesh: heart.msh}", "{mesh: heart.msh, mesh_size_mm: 3}"),
        ["'scene'", "`mesh_size_mm` has no meaning with `mesh`; remove it"],
    ),
    # numbers
    "number with its unit": (_changed("step_ms: 1", "step_ms: 1 ms"), ["'coupling.step_ms' is '1 ms'", *_NO_NUMBER]),
    "number in quotes": (_changed("step_ms: 1", "step_ms: '1'"), ["'coupling.step_ms'", "without quotes"]),
    "time of day": (_changed("step_ms: 1", "step_ms: 1:30"), ["'coupling.step_ms' is '1:30'", *_NO_NUMBER]),
    "word for a number": (_changed("stop_ms: 10", "stop_ms: forever"), ["'run.stop_ms' is 'forever'", *_NO_NUMBER]),
    "true for a number": (_changed("step_ms: 1", "step_ms: true"), ["'coupling.step_ms' is True", *_NO_NUMBER]),
    "nothing for a number": (_changed("step_ms: 1", "step_ms: "), ["'coupling.step_ms' is empty", *_NO_NUMBER]),
    "list for a number": (_changed("step_ms: 1", "step_ms: [1]"), ["'coupling.step_ms' is [1]", *_NO_NUMBER]),
    "negative": (_changed("step_ms: 1", "step_ms: -1"), ["'coupling.step_ms' is -1", "greater than 0"]),
    "zero": (_changed("stop_ms: 10", "stop_ms: 0"), ["'run.stop_ms' is 0", "greater than 0"]),
    "negative output": (_changed("every_ms: 5", "every_ms: -5"), ["'output.every_ms' is -5", "greater than 0"]),
    "negative size": (
        _changed("{mesh: heart.msh}", "{geometry: a, mesh_size_mm: -3}"),
        ["'scene.mesh_size_mm' is -3", "greater than 0"],
    ),
    "NaN": (_changed("step_ms: 1", "step_ms: .nan"), ["'coupling.step_ms' is nan", "finite number"]),
    "infinity": (_changed("stop_ms: 10", "stop_ms: .inf"), ["'run.stop_ms' is inf", "finite number"]),
    "overflow": (_changed("stop_ms: 10", "stop_ms: 1e400"), ["'run.stop_ms' is inf", "finite number"]),
    # times that do not fit
    "stop between steps": (_changed("stop_ms: 10", "stop_ms: 10.5"), ["`run.stop_ms` (10.5 ms)", "`coupling.step_ms`"]),
    "stop before a step": (_changed("stop_ms: 10", "stop_ms: 0.5"), ["`run.stop_ms` (0.5 ms)", "`coupling.step_ms`"]),
    "output between steps": (
        _changed("every_ms: 5", "every_ms: 0.5"),
        ["`output.every_ms` (0.5 ms)", "`coupling.step_ms` (1 ms)", "change one"],
    ),
    "endless run": (_changed("stop_ms: 10", "stop_ms: 1e300"), ["`run.stop_ms`", "1e+300 steps", "refused"]),
    "more steps than numbers": (
        _changed("step_ms: 1", "step_ms: 1e-300").replace("stop_ms: 10", "stop_ms: 1e300"),
        ["`run.stop_ms`", "inf steps", "refused"],
    ),
    # choices
    "misspelt scheme": (
        _changed("gauss-seidel", "Gauss_Seidl"),
        ["'coupling.scheme' is 'Gauss_Seidl'", "'gauss-seidel' or 'jacobi'", "did you mean 'gauss-seidel'?"],
    ),
    "unknown scheme": (_changed("gauss-seidel", "quux"), ["'coupling.scheme' is 'quux'", "'gauss-seidel' or 'jacobi'"]),
    "scheme on": (_changed("gauss-seidel", "on"), ["'coupling.scheme' is 'on'", "'gauss-seidel' or 'jacobi'"]),
    "participants yes": (_changed("native", "yes"), ["'run.participants' is 'yes'", "'fmu', 'fmu3' or 'native'"]),
    "misspelt participants": (_changed("native", "nativ"), ["'run.participants'", "did you mean 'native'?"]),
    "iteration without criteria": (
        _changed("step_ms: 1", "iterate: {max_iterations: 3}"),
        ["'coupling.iterate.converge' is missing"],
    ),
    "interpolation": (
        _changed("step_ms: 1", "interpolation: lineal"),
        ["'coupling.interpolation'", "did you mean 'linear'"],
    ),
    "extrapolation": (_changed("step_ms: 1", "extrapolation: 3"), ["'coupling.extrapolation' is 3", "0, 1 or 2"]),
    "adaptive limits": (
        _changed("step_ms: 1", "adaptive: {min_ms: 3, max_ms: 2}"),
        ["'coupling.adaptive'", "`min_ms` (3) is above `max_ms` (2)"],
    ),
    "adaptive key": (_changed("step_ms: 1", "adaptive: {tolerence: 3}"), ["did you mean 'tolerance'"]),
    "adaptive end": (
        _changed("step_ms: 1", "adaptive: {}").replace("stop_ms: 10", "stop_ms: 12"),
        ["`run.stop_ms` (12 ms)", "`output.every_ms` (5 ms)", "coupling.adaptive"],
    ),
    "workers": (
        _changed("stop_ms: 10", "stop_ms: 10, workers: process"),
        ["'run.workers'", "choose threads, processes"],
    ),
    "time limit": (_changed("stop_ms: 10", "stop_ms: 10, unit_time_limit_s: 5"), ["'run'", "add `workers: processes`"]),
    "no scene": (_changed("scene: {mesh: heart.msh}\n", ""), ["'scene' is missing", "needs a mesh"]),
    "never stepped": (
        _changed("{unit: fiber_generator}", "{unit: fiber_generator, every: 0}"),
        ["'units.fibers.every' is 0"],
    ),
    "start of a unit": (
        _changed("{unit: fiber_generator}", "{unit: fiber_generator, start: {x: 1}}"),
        ["'units.fibers'", "`start` is for the variables of an FMU"],
    ),
    # names
    "number as name": (_changed("name: small", "name: 5"), ["'name' is 5", "expected a text", "quotes"]),
    "no name": (_changed("name: small", "name:"), ["'name' is empty", "expected a text"]),
    "way out of the results folder": (_changed("name: small", "name: ../../x"), ["'name'", "begin with a letter"]),
    "folder above as name": (_changed("name: small", "name: .."), ["'name': '..'", "begin with a letter"]),
    "line break in the name": (_changed("name: small", 'name: "small\\n"'), ["'name'", "not a valid name"]),
    "unit with a space": (_changed("mechanics: {", "the mechanics: {"), ["'units.the mechanics'", "not a valid name"]),
    "unit with a hyphen": (_changed("mechanics: {", "my-mechanics: {"), ["'units.my-mechanics'", "not a valid name"]),
    "unit that begins with a digit": (_changed("mechanics: {", "1st: {"), ["'units.1st'", "begin with a letter"]),
    "unit by number": (_changed("mechanics: {", "1: {"), ["'units.1'", "quotes"]),
    # probes
    "two coordinates": (_changed("[25, 0, -1]", "[25, 0]"), ["'output.probes_mm.base' is [25, 0]", "[x, y, z]"]),
    "four coordinates": (_changed("[25, 0, -1]", "[25, 0, -1, 0]"), ["'output.probes_mm.base'", "[x, y, z]"]),
    "coordinates as text": (_changed("[25, 0, -1]", "25 0 -1"), ["'output.probes_mm.base'", "[x, y, z]"]),
    "coordinates by name": (_changed("[25, 0, -1]", "{x: 25, y: 0, z: -1}"), ["'output.probes_mm.base'", "[x, y, z]"]),
    "word as coordinate": (_changed("[25, 0, -1]", "[25, 0, a]"), ["'output.probes_mm.base.2' is 'a'", *_NO_NUMBER]),
    "coordinate nowhere": (_changed("[25, 0, -1]", "[25, 0, .nan]"), ["'output.probes_mm.base.2'", "finite number"]),
    "coordinate beyond the moon": (
        _changed("[25, 0, -1]", "[25, 0, 1e308]"),
        ["'output.probes_mm.base.2' is 1e+308", "less than or equal to 1000000"],
    ),
    "probe with a space": (_changed("base:", "the base:"), ["'output.probes_mm.the base'", "letters, digits and '_'"]),
    "probe by number": (_changed("base:", "1:"), ["'output.probes_mm.1'", "quotes"]),
    "probes without names": (_changed("{base: [25, 0, -1]}", "[[25, 0, -1]]"), ["'output.probes_mm'", *_NO_SECTION]),
    # parameters
    "list of parameters": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: [a]}"),
        ["'units.mechanics.parameters'", *_NO_SECTION],
    ),
    "parameter of parameters": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: {a: {b: 1}}}"),
        ["'units.mechanics.parameters.a'", "expected a number, a text, true or false"],
    ),
    "empty parameter": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: {a: }}"),
        ["'units.mechanics.parameters.a'", "expected a number"],
    ),
    "date as parameter": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: {a: 2020-01-01}}"),
        ["'units.mechanics.parameters.a'", "expected a number"],
    ),
    "parameter NaN": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: {a: .nan}}"),
        ["'units.mechanics.parameters.a'", "finite number"],
    ),
    "parameter of 400 digits": (
        _changed("{unit: mechanics}", "{unit: mechanics, parameters: {a: " + "1" * 400 + "}}"),
        ["'units.mechanics.parameters.a'", "finite number"],
    ),
    # connections and order
    "one connection": (SMALL + "connections: a.b -> c.d\n", ["'connections' is 'a.b -> c.d'", "expected a list"]),
    "connection by colon": (SMALL + "connections:\n  - a.b: c.d\n", ["'connections.0'", "expected a text"]),
    "no connections": (SMALL + "connections:\n", ["'connections' is empty", "expected a list"]),
    "one unit as order": (_changed("step_ms: 1", "order: mechanics"), ["'coupling.order'", "expected a list"]),
    "order by number": (_changed("step_ms: 1", "order: [1]"), ["'coupling.order.0' is 1", "expected a text"]),
    "connections in themselves": (SMALL + "connections: &a [*a]\n", ["line 9", "'&a' contains itself"]),
}


@pytest.mark.parametrize(("content", "words"), _WRONG.values(), ids=_WRONG)
def test_one_short_line_names_file_key_and_remedy(tmp_path: Path, content: str | bytes, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        _load(tmp_path, content)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'scene.yaml'}: ")
    for word in words:
        assert word in message
    line = message.removeprefix(str(tmp_path))
    assert "\n" not in line
    assert len(line) < 300
    for jargon in ("pydantic", "dictionary", "validation", "instance of", "Traceback", "ruamel"):
        assert jargon not in message


def test_several_problems_are_told_at_once_each_in_its_line(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        _load(tmp_path, _changed("step_ms: 1", "step_ms: 0").replace("native", "nativ") + "zzz: 1\n")
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    for line, key in zip(lines, ("coupling.step_ms", "run.participants", "zzz"), strict=True):
        assert line.startswith(f"{tmp_path / 'scene.yaml'}: ")
        assert key in line


def test_a_long_wrong_value_is_cut_short(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        _load(tmp_path, _changed("step_ms: 1", f"step_ms: [{'1, ' * 5000}]"))
    assert len(str(caught.value).removeprefix(str(tmp_path))) < 300


def test_paths_that_hold_no_scenario(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"missing\.yaml: no such scenario file"):
        load_scenario(tmp_path / "missing.yaml")
    with pytest.raises(InputError, match="this is a folder"):
        load_scenario(tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be read"):
        load_scenario(tmp_path / "file" / "scene.yaml")
    with pytest.raises(InputError, match="cannot be read"):
        load_scenario(tmp_path / ("long" * 100))


@pytest.mark.parametrize(
    ("assignment", "get", "value"),
    [
        ("run.stop_ms=20", lambda s: s.run.stop_ms, 20.0),
        ("run.stop_ms=2e1", lambda s: s.run.stop_ms, 20.0),
        (" run . stop_ms = 20", lambda s: s.run.stop_ms, 20.0),
        ("name=other", lambda s: s.name, "other"),
        ("name='5'", lambda s: s.name, "5"),
        ("units.mechanics.parameters.shear=1.5", lambda s: s.units["mechanics"].parameters, {"shear": 1.5}),
        ("units.mechanics.parameters={a: 1, b: x}", lambda s: s.units["mechanics"].parameters, {"a": 1, "b": "x"}),
        ("units.mechanics.parameters.a=b=c", lambda s: s.units["mechanics"].parameters, {"a": "b=c"}),
        ("units.extra.unit=mechanics", lambda s: list(s.units), ["fibers", "mechanics", "extra"]),
        ("output.probes_mm.tip=[0, 0, -60]", lambda s: s.output.probes_mm["tip"], [0, 0, -60]),
        ("output.probes_mm={}", lambda s: s.output.probes_mm, {}),
        ("connections=[a.b -> c.d]", lambda s: s.connections, ["a.b -> c.d"]),
        ("coupling.order=[mechanics]", lambda s: s.coupling.order, ["mechanics"]),
        ("coupling.order=null", lambda s: s.coupling.order, None),
        ("coupling.iterate=", lambda s: s.coupling.iterate, None),
    ],
)
def test_set_changes_one_value_and_nothing_else(tmp_path: Path, assignment: str, get: object, value: object) -> None:
    assert callable(get)
    changed, plain = _load(tmp_path, SMALL, assignment), _load(tmp_path, SMALL)
    assert get(changed) == value
    section = assignment.replace(" ", "").split("=")[0].split(".")[0]
    assert changed.model_dump(exclude={section}) == plain.model_dump(exclude={section})


def test_set_applies_in_order_and_the_last_one_wins(tmp_path: Path) -> None:
    assert _load(tmp_path, SMALL, "run.stop_ms=20", "run.stop_ms=30").run.stop_ms == 30.0
    assert _load(tmp_path, SMALL, "run={stop_ms: 20}", "run.participants=fmu").run.stop_ms == 20.0


def test_set_reaches_into_one_of_two_sections_that_are_one_by_an_alias(tmp_path: Path) -> None:
    text = _changed("{unit: mechanics}", "&m {unit: mechanics, parameters: {a: 1}}\n  other: *m")
    scenario = _load(tmp_path, text, "units.other.parameters.a=2")
    assert scenario.units["mechanics"].parameters == {"a": 1}
    assert scenario.units["other"].parameters == {"a": 2}


_GEOMETRY = SMALL.replace("{mesh: heart.msh}", "{geometry: slab, mesh_size_mm: 3, refine: 1}")
_MESH = SMALL.replace("{mesh: heart.msh}", "{mesh: heart.msh, boundaries: {base: 3}, scale: cm, refine: 1}")


def test_a_mesh_that_is_set_takes_the_place_of_a_geometry_and_its_size(tmp_path: Path) -> None:
    changed = _load(tmp_path, _GEOMETRY, "scene.mesh=own.msh", "scene.boundaries.base=[1, 2]").scene
    assert changed is not None
    assert (changed.geometry, changed.mesh, changed.refine) == (None, "own.msh", 1)
    assert changed.boundaries == {"base": [1, 2]}
    # What the file says of its own mesh holds for another one, too.
    other = _load(tmp_path, _MESH, "scene.mesh=own.msh").scene
    assert other is not None
    assert (other.mesh, other.boundaries, other.scale) == ("own.msh", {"base": [3]}, "cm")


def test_a_geometry_that_is_set_takes_the_place_of_a_mesh_and_what_is_said_of_it(tmp_path: Path) -> None:
    for sets in (("scene.geometry=slab", "scene.mesh_size_mm=4"), ("scene.mesh_size_mm=4", "scene.geometry=slab")):
        changed = _load(tmp_path, _MESH, *sets).scene
        assert changed is not None
        assert (changed.geometry, changed.mesh, changed.mesh_size_mm) == ("slab", None, 4.0)
        assert (changed.boundaries, changed.scale, changed.refine) == ({}, None, 1)


@pytest.mark.parametrize(
    ("content", "sets", "words"),
    [
        (_GEOMETRY, ("scene.mesh=a.msh", "scene.geometry=slab"), "either `geometry`"),
        (_MESH, ("scene.geometry=slab", "scene.mesh=a.msh"), "either `geometry`"),
        (_GEOMETRY, ("scene={geometry: slab}", "scene.mesh=a.msh"), "either `geometry`"),
        (_GEOMETRY, ("scene.mesh=a.msh", "scene.mesh_size_mm=3"), "`mesh_size_mm` has no meaning with `mesh`"),
        (_MESH, ("scene.geometry=slab", "scene.scale=m"), "`boundaries` and `scale` are for"),
        (_MESH, ("scene.geometry=slab", "scene.boundaries.base=4"), "`boundaries` and `scale` are for"),
        # Nothing is set by null, so that nothing is replaced.
        (_GEOMETRY, ("scene.geometry=null",), "either `geometry`"),
    ],
)
def test_what_is_set_together_and_cannot_stand_together_is_refused(
    tmp_path: Path, content: str, sets: tuple[str, ...], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        _load(tmp_path, content, *sets)


def test_studies_and_notebooks_replace_a_geometry_in_the_same_way_and_leave_the_content_alone(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(_GEOMETRY)
    content = scenario_content(tmp_path / "scene.yaml")
    changed = with_settings(content, {"scene.mesh": "own.msh"})
    assert changed["scene"] == {"mesh": "own.msh", "refine": 1}
    assert content["scene"] == {"geometry": "slab", "mesh_size_mm": 3, "refine": 1}
    assert with_settings(content, {"scene.mesh": None})["scene"] == content["scene"] | {"mesh": None}


def test_no_other_section_that_is_one_with_the_scene_by_an_alias_loses_anything(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text("scene: &a {geometry: slab, mesh_size_mm: 3}\nother: *a\n")
    changed = with_settings(scenario_content(tmp_path / "scene.yaml"), {"scene.mesh": "own.msh"})
    assert changed == {"scene": {"mesh": "own.msh"}, "other": {"geometry": "slab", "mesh_size_mm": 3}}


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("run.stop_ms", ["write it as key.path=value"]),
        ("=3", ["write it as key.path=value"]),
        ("", ["write it as key.path=value"]),
        (".=3", ["write it as key.path=value"]),
        ("run..stop_ms=3", ["write it as key.path=value"]),
        ("run.=3", ["write it as key.path=value"]),
        ("name.x=3", ["'name' holds 'small', not a section", "--set name="]),
        ("output.probes_mm.base.0=3", ["'base' holds [25, 0, -1]", "--set output.probes_mm.base="]),
        ("run.stop_ms=[", ["the value is not valid YAML"]),
        ("name=@x", ["the value is not valid YAML", "quotes"]),
        ("name=2020-13-45", ["the value is not valid YAML", "quotes"]),
        ("run.stop_ms=1\n---\n2", ["the value is not valid YAML"]),
        ("runn.stop_ms=3", ["unknown key 'runn'", "did you mean 'run'?"]),
        ("run.stop=3", ["unknown key 'run.stop'", "did you mean 'stop_ms'?"]),
        ("run.stop_ms=", ["'run.stop_ms' is empty"]),
        ("run.stop_ms=10 ms", ["'run.stop_ms' is '10 ms'", "expected a number"]),
        ("run.stop_ms==3", ["'run.stop_ms' is '=3'", "expected a number"]),
        ("run=5", ["'run' is 5", "expected a section"]),
        ("coupling.scheme=jacoby", ["'coupling.scheme' is 'jacoby'", "did you mean 'jacobi'?"]),
        ("units.mechanics=null", ["'units.mechanics' is empty"]),
    ],
)
def test_a_wrong_set_is_repeated_in_the_message_with_the_remedy(
    tmp_path: Path, assignment: str, words: list[str]
) -> None:
    with pytest.raises(InputError) as caught:
        _load(tmp_path, SMALL, assignment)
    message = str(caught.value)
    for word in (f"--set {' '.join(assignment.splitlines())}:", *words):
        assert word in message


def test_a_loaded_scenario_cannot_be_changed_behind_the_runs_back(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="frozen"):
        _load(tmp_path, SMALL).run.stop_ms = 5.0
