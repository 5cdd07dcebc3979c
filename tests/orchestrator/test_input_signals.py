"""If these fail, a measured input drives a unit with other values, or at other times, than the file has."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_box
import numpy as np
import pytest
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.run import run_scenario, show_scenario
from cardiac_cosim.orchestrator.scenario import load_scenario
from written import rows

needs_compiler = pytest.mark.skipif(build_box.compiler() is None, reason="no C compiler to build foreign FMUs with")

_VARIABLES = [
    ("u", "Real", "input", 0),
    ("y", "Real", "output", 16),
    ("step", "Real", "input", 1, 'variability="discrete"'),
    ("n", "Integer", "input", 0),
    ("m", "Integer", "output", 16),
    ("b", "Boolean", "input", 0),
    ("c", "Boolean", "output", 16),
    ("s", "String", "input", 0),
    ("t", "String", "output", 16),
    ("v[1]", "Real", "input", 2),
    ("v[2]", "Real", "input", 3),
    ("w[1]", "Real", "output", 18),
    ("w[2]", "Real", "output", 19),
]

_SCENARIO = """\
name: driven
units: {a: {fmu: a.fmu}}
inputs: {file: x.csv}
coupling: {step_ms: 500}
run: {stop_ms: 3000, checkpoint_every: 1}
output: {every_ms: 3000}
"""

Simulate = Callable[..., list[dict[str, str]]]


@pytest.fixture
def simulate(tmp_path: Path) -> Simulate:
    """Run one box for three seconds, driven by the file given; the rows of the time series."""

    def run(text: str, *sets: str, interpolates: bool = True) -> list[dict[str, str]]:
        attributes = 'canInterpolateInputs="true"' if interpolates else ""
        build_box.build_box(tmp_path / "a.fmu", _VARIABLES, attributes=attributes)
        (tmp_path / "x.csv").write_text(text, encoding="utf-8")
        (tmp_path / "s.yaml").write_text(_SCENARIO)
        run_scenario(load_scenario(tmp_path / "s.yaml", sets), tmp_path, tmp_path / "out")
        return rows(tmp_path / "out")

    return run


_JUMP = "time,a.u\n0.0,0\n1.0,2\n1.0,10\n2.0,10\n"


@needs_compiler
def test_ramped_inputs_follow_the_file_exactly_through_its_kinks_and_jumps(simulate: Simulate) -> None:
    rows = simulate(_JUMP, "coupling.interpolation=linear", "coupling.step_ms=250")
    exact = [t * t if t <= 1.0 else 1.0 + 10.0 * (t - 1.0) for t in np.arange(13) * 0.25]
    np.testing.assert_allclose([float(row["y"]) for row in rows], exact, rtol=1e-14)


@needs_compiler
@pytest.mark.parametrize("settings", [(), ("coupling.interpolation=linear",)])
def test_held_inputs_are_those_of_the_steps_end(simulate: Simulate, settings: Any) -> None:
    rows = simulate(_JUMP, *settings, interpolates=False)
    # Half a second each of 1, then, from the jump on, of 10.
    assert [float(row["y"]) for row in rows] == [0.0, 0.5, 5.5, 10.5, 15.5, 20.5, 25.5]


@needs_compiler
def test_what_is_not_continuous_holds_its_last_value(simulate: Simulate) -> None:
    text = "time_ms, step ,n,b,s\n0,4,5,false,\n1200,8,-7.0,TRUE,now\n1400,0,1,1,höher\n"
    rows = simulate(text, "output.variables=[a.step, a.m, a.c, a.t]")
    assert [row["step"] for row in rows] == ["4.0"] * 3 + ["0.0"] * 4
    assert [row["m"] for row in rows] == ["6"] * 3 + ["2"] * 4
    assert [row["c"] for row in rows] == ["1"] * 3 + ["0"] * 4
    assert [row["t"] for row in rows] == ["<>"] * 3 + ["<höher>"] * 4


@needs_compiler
def test_elements_of_an_array_are_driven_by_their_names(simulate: Simulate) -> None:
    rows = simulate('time,"a.v[2]"\n0,3\n')
    assert (rows[-1]["w[1]"], rows[-1]["w[2]"]) == ("0.0", "9.0")
    with pytest.raises(InputError, match=r"column 'v': a\.v is an array; give columns for v\[1\] to v\[2\]"):
        simulate("time,v\n0,3\n")


@needs_compiler
@pytest.mark.parametrize("every", [1, 3])
def test_units_that_wait_see_the_file_over_their_own_steps(simulate: Simulate, every: int) -> None:
    rows = simulate(_JUMP, f"units.a.every={every}", "coupling.interpolation=linear")
    # A line from 0 to 1.5 s begins at 0 and ends at 10.
    expected = {1: 1.0 + 20.0, 3: 0.5 * 1.5 * 10.0 + 15.0}
    assert float(rows[-1]["y"]) == expected[every]


@needs_compiler
def test_a_driven_run_goes_on_from_a_checkpoint(simulate: Simulate, tmp_path: Path, stopped: Any) -> None:
    whole = simulate(_JUMP, "coupling.interpolation=linear")
    scenario = load_scenario(tmp_path / "s.yaml", ["coupling.interpolation=linear"])
    stopped(3, scenario, tmp_path, tmp_path / "out")
    content = (tmp_path / "x.csv").read_text()
    (tmp_path / "x.csv").write_text(content.replace("10", "11"))
    with pytest.raises(InputError, match=r"x\.csv has changed since"):
        run_scenario(scenario, tmp_path, tmp_path / "out", resume=True)
    (tmp_path / "x.csv").write_text(content)
    run_scenario(scenario, tmp_path, tmp_path / "out", resume=True)
    assert rows(tmp_path / "out") == whole


@needs_compiler
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "it has no values"),
        ("time,u\n", "it has no values"),
        ("t,u\n0,1\n", "the first column is 't'; it has to be time_ms, or time"),
        ("time;u\n0;1\n", "the first column is 'time;u'"),
        ("time,uu\n0,1\n", "column 'uu' is not an input of any unit; did you mean 'u'"),
        ("time,a.y\n0,1\n", r"column 'a\.y' is not an input of any unit"),
        ("time,u\n0,1\n2,1\n1,1\n", "row 4: the time decreases from 2 to 1 s"),
        ("time,u\n0,1\n0,1\n0,1\n", "row 4: three rows have the time 0 s"),
        ("time,u\n0,nan\n", "column 'u', row 2: 'nan' is not a valid value of the input"),
        ("time,u\n0,1\n1,\n", "column 'u', row 3: '' is not a valid value"),
        ("time,u\n0,one\n", "column 'u', row 2: 'one' is not a valid value"),
        ("time,n\n0,1.5\n", r"column 'n', row 2: '1\.5' is not a valid value"),
        ("time,n\n0,3000000000\n", "column 'n', row 2: '3000000000' is not a valid value"),
        ("time,b\n0,2\n", "column 'b', row 2: '2' is not a valid value"),
        ("time,u\n0,1,2\n", "row 2 has 3 cells, but there are 2 columns"),
        ("time,u,u\n0,1,2\n", "a column 'u' occurs twice"),
        ("time,u,a.u\n0,1,2\n", r"column 'a\.u': the input a\.u is connected, or driven by another column"),
        ("time,\n0,1\n", "a column without a name"),
    ],
)
def test_what_a_file_cannot_say_is_explained(simulate: Simulate, text: str, words: str) -> None:
    with pytest.raises(InputError, match=rf"inputs\.file: .*x\.csv: .*{words}"):
        simulate(text)


@needs_compiler
def test_an_input_is_either_connected_or_driven(simulate: Simulate) -> None:
    for text, words in (("time,a.u\n0,1\n", r"the input a\.u is connected"), ("time,v[1]\n0,1\n", "connected")):
        with pytest.raises(InputError, match=words):
            simulate(text, "connections=[a.y -> a.u, a.w -> a.v]")
    # By its bare name the one that is free is meant.
    rows = simulate(
        "time,u\n0,1\n",
        "units={a: {fmu: a.fmu}, b: {fmu: a.fmu}}",
        "connections=[a.y -> b.u]",
        "connect_by_name=false",
        "output.variables=[a.u, b.u]",
    )
    assert rows[-1]["a.u"] == "1.0"
    with pytest.raises(InputError, match=r"several units have this input; name it a\.u or b\.u"):
        simulate("time,u\n0,1\n", "units={a: {fmu: a.fmu}, b: {fmu: a.fmu}}", "connect_by_name=false")


@needs_compiler
def test_show_tells_what_is_driven(simulate: Simulate, tmp_path: Path) -> None:
    simulate(_JUMP)
    shown = show_scenario(load_scenario(tmp_path / "s.yaml"), tmp_path)
    assert "x.csv -> a.u" in shown
    assert "a.u: no unit gives it" not in shown
    assert "a.step: no unit gives it" in shown
    assert "does not see how the signals in x.csv change" not in shown
    scenario = load_scenario(tmp_path / "s.yaml", ["coupling.adaptive={max_ms: 50}"])
    assert "does not see how the signals in x.csv change within a step; keep `max_ms` (50 ms)" in show_scenario(
        scenario, tmp_path
    )


def test_a_unit_of_our_own_is_driven_alike_directly_and_through_its_fmu(tmp_path: Path, fmu_dir: Path) -> None:
    (tmp_path / "x.csv").write_text("time_ms,potential\n0,-80\n4,-80\n6,20\n")
    (tmp_path / "s.yaml").write_text(
        "name: cell\nscene: {geometry: cell}\nunits: {tension: {unit: active_stress}}\ninputs: {file: x.csv}\n"
        "coupling: {step_ms: 1, interpolation: linear}\nrun: {stop_ms: 10}\noutput: {every_ms: 10}\n"
    )
    found = []
    for kind in ("native", "fmu"):
        scenario = load_scenario(tmp_path / "s.yaml", [f"run.participants={kind}"])
        run_scenario(scenario, tmp_path, tmp_path / kind, fmu_dir=fmu_dir)
        found.append((tmp_path / kind / "timeseries.csv").read_text())
    assert found[0] == found[1]
    assert float(rows(tmp_path / "fmu")[-1]["active_stress_mean_kPa"]) > 1.0
