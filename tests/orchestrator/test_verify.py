"""If these fail, an FMU that computes something else than its maker got passes for verified, or a sound one fails."""

import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import build_box
import pytest
import reference
from cardiac_cosim.orchestrator.errors import InputError
from cardiac_cosim.orchestrator.verification import Verdict, verify_fmu
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

pytestmark = pytest.mark.skipif(build_box.compiler() is None, reason="no C compiler to build foreign FMUs with")

Cosim = Callable[..., Any]
Files = dict[str, str | None]

_VARIABLES: list[build_box.Declared] = [
    ("u", "Real", "input", 0),
    ("n", "Integer", "input", 0),
    ("b", "Boolean", "input", 0),
    ("t", "String", "input", 0),
    ("y", "Real", "output", 16),
    ("m", "Integer", "output", 16),
    ("c", "Boolean", "output", 16),
    ("s", "String", "output", 16),
    ("x[1]", "Real", "output", 17),
    ("x[2]", "Real", "output", 18),
    ("p", "Real", "parameter", 1),
    ("reached", "Real", "local", 32),
]
# y' = u, held over each step of 0.5 s; u runs from 0 to 2 in 1 s and jumps to 10 there. m = n + 1, c = not b, s = <t>.
_IN = 'time,u,n,b,t\n0,0,1,false,a\n1,2,5,true,"b, c"\n1,10,5,true,"b, c"\n2,10,7,true,d\n'
_OUT = (
    'time,y,m,c,s,reached\n0,0,2,true,<a>,0\n0.5,0,2,true,<a>,0.5\n1,0.5,2,true,<a>,1\n1.5,5.5,6,false,"<b, c>",1.5\n'
    '2,10.5,6,false,"<b, c>",2\n'
)
_GIVEN = 'stopTime="2" stepSize="0.5" tolerance="1e-9"'


def _files(version: str = "1.0.0-beta.1") -> Files:
    return {
        "fmi-ls-manifest.xml": reference.manifest(reference.related(version), version),
        "tests.exp": reference.experiments(_GIVEN),
        "in.csv": _IN,
        "out.csv": _OUT,
    }


@pytest.fixture
def fmu(tmp_path: Path) -> Callable[..., Path]:
    """An FMU with some files changed; `head` goes into its description."""

    def make(changes: Files | None = None, head: str = "", files: Files | None = None) -> Path:
        box = build_box.build_box(tmp_path / "plain.fmu", _VARIABLES, head)
        return reference.with_files(box, tmp_path / "box.fmu", (files or _files()) | (changes or {}))

    return make


def _verdicts(path: Path) -> dict[str, Verdict]:
    (outcome,) = verify_fmu(path).outcomes
    assert outcome.failure is None, outcome.failure
    return {item.variable: item.verdict for item in outcome.comparisons}


def _failure(path: Path) -> str:
    verification = verify_fmu(path)
    assert not verification.is_verified
    (outcome,) = verification.outcomes
    assert outcome.failure is not None
    return outcome.failure


# --- what is sound ------------------------------------------------------------------------------------------------


def test_an_experiment_may_begin_elsewhere_than_at_zero(fmu: Callable[..., Path]) -> None:
    def later(line: str) -> str:
        time, rest = line.split(",", 1)
        return line if time == "time" else f"{float(time) + 1.0:g},{rest}"

    inputs = "".join(f"{later(line)}\n" for line in _IN.splitlines())
    # The last column is the time that the FMU has come to, in steps: this one does not know where they begin.
    rows = [later(line).rsplit(",", 1) for line in _OUT.splitlines()]
    results = "".join(f"{row},{last if last in ('reached', '0') else row.split(',')[0]}\n" for row, last in rows)
    given = 'startTime="1" stopTime="3" stepSize="0.5" tolerance="1e-9"'
    verdicts = _verdicts(fmu({"tests.exp": reference.experiments(given), "in.csv": inputs, "out.csv": results}))
    assert set(verdicts.values()) == {Verdict.WITHIN}


@pytest.mark.parametrize("version", list(reference.TYPES))
def test_variables_of_all_types_are_as_the_stimuli_make_them(fmu: Any, version: str) -> None:
    verdicts = _verdicts(fmu(files=_files(version)))
    assert verdicts == dict.fromkeys(("y", "m", "c", "s", "reached"), Verdict.WITHIN)


def test_an_unpacked_fmu_is_as_good(fmu: Any, tmp_path: Path) -> None:
    zipfile.ZipFile(fmu()).extractall(tmp_path / "folder")
    assert verify_fmu(tmp_path / "folder").is_verified


def test_experiments_of_the_first_draft_stand_in_the_manifest(fmu: Any) -> None:
    element = f'<Experiment name="one" {_GIVEN}><Stimuli source="in.csv"/><References source="out.csv"/></Experiment>'
    statement = ' fmi-ls:fmi-ls-description="Layered Standard providing reference stimuli and results for an FMU."'
    manifest = reference.manifest(element, "1.0.0-rc.1", statement)
    assert verify_fmu(fmu({"fmi-ls-manifest.xml": manifest, "tests.exp": None})).is_verified


def test_a_result_by_itself_is_that_of_the_default_experiment(fmu: Any) -> None:
    # As in the Reference-FMUs, which leave out the statement too; without inputs, y stays 0 and m is 1.
    manifest = reference.manifest('<Related type="text/csv" source="out.csv" role="result"/>', "1.0.0-alpha.1", "")
    out = "time,y,m,reached\n0,0,1,0\n1,0,1,1\n2,0,1,2\n"
    files = {"fmi-ls-manifest.xml": manifest, "out.csv": out}
    assert verify_fmu(fmu(files=files, head='<DefaultExperiment startTime="0" stopTime="2" stepSize="1"/>')).is_verified
    # Where nobody says anything of steps, the results do.
    assert verify_fmu(fmu(files=files)).is_verified
    for end, told in ((3, "the results end at 2 s"), (1, "continue to 2 s")):
        other = fmu(files=files, head=f'<DefaultExperiment startTime="0" stopTime="{end}"/>')
        assert told in _failure(other)


def test_columns_of_types_that_fmi_2_lacks_are_left_out_of_results_by_themselves_only(fmu: Any) -> None:
    # Reference-FMUs' Feedthrough has the results of its FMI 3.0 form in its FMI 2.0 form too.
    alone = {"fmi-ls-manifest.xml": reference.manifest('<Related type="text/csv" source="out.csv" role="result"/>')}
    alone["out.csv"] = "time,y,Int8_output\n0,0,0\n1,0,0\n"
    path = fmu(files=alone)
    assert _verdicts(path) == {"y": Verdict.WITHIN, "Int8_output": Verdict.LEFT_OUT}
    assert verify_fmu(path).is_verified
    assert "Int8_output" in verify_fmu(path).notes[0]
    # But not everything can be left out, and an experiment's own results are those of this FMU.
    assert "none of the variables" in _failure(fmu(files=alone | {"out.csv": "time,Int8_output\n0,0\n1,0\n"}))
    own = _files() | {"out.csv": _OUT.replace("time,y,", "time,Int8_output,")}
    assert _verdicts(fmu(files=own))["Int8_output"] is Verdict.LACKING


def test_an_experiment_without_results_is_run_but_verifies_nothing(bodies: dict[str, Path], tmp_path: Path) -> None:
    bare = '<Experiment name="two" stopTime="END" stepSize="0.01"/>'
    one = reference.experiments('stopTime="0.02" stepSize="0.01"', '<References source="out.csv"/>')
    files: Files = {
        "fmi-ls-manifest.xml": reference.manifest(reference.related()),
        "tests.exp": one.replace("</Experiments>", f"{bare}</Experiments>").replace("END", "0.02"),
        "out.csv": "time,x\n0,0\n0.02,0\n",
    }
    verification = verify_fmu(reference.with_files(bodies["dies"], tmp_path / "a.fmu", files))
    assert verification.is_verified
    assert [outcome.compared for outcome in verification.outcomes] == [1, 0]
    assert "'two' has no results" in verification.notes[0]
    # It fails all the same where the FMU does.
    files["tests.exp"] = one.replace("</Experiments>", f"{bare}</Experiments>").replace("END", "0.1")
    verification = verify_fmu(reference.with_files(bodies["dies"], tmp_path / "a.fmu", files))
    assert not verification.is_verified
    assert "experiment 'two': the FMU failed in the step from 0.05" in verification.reasons[0]
    files["tests.exp"] = f'<Experiments name="tests">{bare.replace("END", "0.02")}</Experiments>'
    with pytest.raises(InputError, match="no experiment with results"):
        verify_fmu(reference.with_files(bodies["dies"], tmp_path / "a.fmu", files))


def test_parameters_of_the_set_are_applied(fmu: Any) -> None:
    ssv = (
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" '
        'name="set"><ssv:Parameters><ssv:Parameter name="VARIABLE"><ssv:Real value="3"/></ssv:Parameter>'
        "</ssv:Parameters></ssv:ParameterSet>"
    )
    # The parameter has the place of an input in the library: x[1] is its integral.
    inside = '<Parameters source="set.ssv"/><References source="out.csv"/>'
    files = _files() | {"tests.exp": reference.experiments(_GIVEN, inside)}
    files |= {"out.csv": "time,x[1]\n0,0\n1,3\n2,6\n", "set.ssv": ssv.replace("VARIABLE", "p")}
    assert verify_fmu(fmu(files=files)).is_verified
    unknown = fmu(files=files | {"set.ssv": ssv.replace("VARIABLE", "q")})
    assert not verify_fmu(unknown).is_verified
    assert "no variable 'q'" in verify_fmu(unknown).notes[0]
    with pytest.raises(InputError, match=r"set.ssv: the parameter 'p' of type Real cannot be 'x'"):
        verify_fmu(fmu(files=files | {"set.ssv": ssv.replace("VARIABLE", "p").replace('"3"', '"x"')}))


def test_an_fmu_may_end_the_simulation_where_its_results_end(bodies: dict[str, Path], tmp_path: Path) -> None:
    files: Files = {
        "fmi-ls-manifest.xml": reference.manifest(reference.related()),
        "tests.exp": reference.experiments('stopTime="0.1" stepSize="0.01"', '<References source="out.csv"/>'),
        "out.csv": "time,x\n" + "".join(f"{0.01 * step:g},0\n" for step in range(6)),
    }
    assert verify_fmu(reference.with_files(bodies["ends"], tmp_path / "e.fmu", files)).is_verified
    files["out.csv"] = "time,x\n" + "".join(f"{0.01 * step:g},0\n" for step in range(11))
    assert "ended the simulation" in _failure(reference.with_files(bodies["ends"], tmp_path / "e.fmu", files))


def test_arrays_of_fmi_3_stand_in_one_cell(tmp_path: Path) -> None:
    array = "<Float64 name='{}' valueReference='{}' causality='{}' {}><Dimension start='3'/></Float64>"
    box = build_box.build_box3(
        tmp_path / "box3.fmu", array.format("u", 0, "input", "start='0 0 0'") + array.format("y", 1, "output", "")
    )
    inside = '<Stimuli source="in.csv"/><References source="out.csv"/>'
    files: Files = {
        "fmi-ls-manifest.xml": reference.manifest(reference.related()),
        "tests.exp": reference.experiments('stopTime="2" stepSize="1"', inside),
        "in.csv": "time,u\n0,1 2 3\n2,3 2 1\n",
        "out.csv": "time,y\n0,2 3 4\n1,2 3 4\n2,3 3 3\n",
    }
    assert verify_fmu(reference.with_files(box, tmp_path / "a.fmu", files)).is_verified
    off = files | {"out.csv": "time,y\n0,2 3 4\n1,2 3 4\n2,3 3 3.1\n"}
    (item,) = verify_fmu(reference.with_files(box, tmp_path / "a.fmu", off)).outcomes[0].comparisons
    assert item.verdict is Verdict.DEVIATES
    assert item.deviation == pytest.approx(0.1)
    assert item.time_s == 2.0
    short = files | {"out.csv": "time,y\n0,2 3 4\n1,2 3\n2,3 3 3\n"}
    assert "2 values of 'y' in row 3" in _failure(reference.with_files(box, tmp_path / "a.fmu", short))
    narrow = files | {"in.csv": "time,u\n0,1 2\n"}
    with pytest.raises(InputError, match="row 2: 2 values, but the input has 3"):
        verify_fmu(reference.with_files(box, tmp_path / "a.fmu", narrow))


# --- what is not: the FMU or its results --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("column", "old", "new"),
    [
        ("y", "1.5,5.5,6", "1.5,5.50000002,6"),
        ("m", "1.5,5.5,6", "1.5,5.5,5"),
        ("c", "6,false", "6,true"),
        ("s", "<b, c>", "<b,c>"),
        ("reached", "1.5\n2", "1.5001\n2"),
    ],
)
def test_a_single_changed_value_is_told(fmu: Any, column: str, old: str, new: str) -> None:
    verdicts = _verdicts(fmu({"out.csv": _OUT.replace(old, new, 1)}))
    assert {name for name, verdict in verdicts.items() if verdict is Verdict.DEVIATES} == {column}


def test_the_tolerance_is_that_of_the_experiment(fmu: Any) -> None:
    # Relative to the largest value, 10.5.
    for tolerance, verdict in (("1.1e-3", Verdict.WITHIN), ("0.9e-3", Verdict.DEVIATES)):
        changes = {"out.csv": _OUT.replace("1,0.5,2", "1,0.5105,2")}
        changes |= {"tests.exp": reference.experiments(f'stopTime="2" stepSize="0.5" tolerance="{tolerance}"')}
        assert _verdicts(fmu(changes))["y"] is verdict


def test_a_variable_that_the_fmu_lacks_is_told(fmu: Any) -> None:
    path = fmu({"out.csv": _OUT.replace("time,y,", "time,yy,")})
    assert _verdicts(path)["yy"] is Verdict.LACKING
    assert not verify_fmu(path).is_verified


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (_OUT, "", "empty"),
        (_OUT, "time,y\n", "no values"),
        (_OUT, "time\n0\n1\n", "no variable"),
        (_OUT, "time,zz\n0,0\n2,0\n", "none of the variables"),
        ("1.5,5.5", "1.5,NaN", "'NaN' for 'y' in row 5"),
        ("1.5,5.5", "1.5,", "'' for 'y' in row 5"),
        ("1.5,5.5,6", "1.5,5.5,6.5", "'6.5' for 'm' in row 5"),
        ("time,y", "t,y", "it has to be time"),
        ("\n1.5,5.5", "\n1.4,5.5", "not a communication point"),
        ("\n1.5,5.5", "\n0.9,5.5", "the time decreases"),
        ("\n1.5,5.5", "\n1,5.5", "twice"),
        ("\n1.5,5.5", "\nnan,5.5", "finite number"),
        ("\n1.5,5.5", "\n1.0000000001,5.5", "two rows at the communication point"),
        ("\n0,0,2,true,<a>,0", "", "begin at 0.5 s"),
        ('\n2,10.5,6,false,"<b, c>",2', "", "end at 1.5 s"),
        ("<a>,0.5", "<a>", "5 cells"),
    ],
)
def test_results_that_are_none_fail(fmu: Any, old: str, new: str, told: str) -> None:
    assert old in _OUT
    assert told in _failure(fmu({"out.csv": _OUT.replace(old, new, 1)}))


def test_an_fmu_that_fails_is_told_with_the_time(bodies: dict[str, Path], tmp_path: Path) -> None:
    files: Files = {
        "fmi-ls-manifest.xml": reference.manifest(reference.related()),
        "tests.exp": reference.experiments('stopTime="0.1" stepSize="0.01"', '<References source="out.csv"/>'),
        "out.csv": "time,x\n" + "".join(f"{0.01 * step:g},0\n" for step in range(11)),
    }
    told = _failure(reference.with_files(bodies["dies"], tmp_path / "dies.fmu", files))
    assert "the FMU failed in the step from 0.05 to 0.06 s" in told
    # One that ends the process, with the exit code of success, does not pass either.
    path = reference.with_files(bodies["leaves"], tmp_path / "leaves.fmu", files)
    command = [sys.executable, "-m", "cardiac_cosim.cli", "verify", str(path)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 3, ended
    assert "leaves" in ended.stderr


# --- what is not: the package -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"fmi-ls-manifest.xml": None}, "no reference experiments in it"),
        ({"fmi-ls-manifest.xml": "<fmiReferences"}, "not well-formed XML"),
        ({"fmi-ls-manifest.xml": "<x/>"}, "not a manifest of org.fmi-standard.fmi-ls-ref"),
        ({"fmi-ls-manifest.xml": "<!DOCTYPE x []><fmiReferences/>"}, "document type"),
        ({"fmi-ls-manifest.xml": reference.manifest("")}, "no experiment with results"),
        ({"fmi-ls-manifest.xml": reference.manifest('<Related source="a" role="cook"/>')}, "role"),
        ({"fmi-ls-manifest.xml": reference.manifest("<Relative/>")}, "does not follow the schema of FMI-LS-REF"),
        (
            {"fmi-ls-manifest.xml": reference.manifest(reference.related(role="experiment/uncertainty-analysis"))},
            "no exp",
        ),
        ({"tests.exp": None}, "there is no extra/org.fmi-standard.fmi-ls-ref/tests.exp in the FMU"),
        ({"out.csv": None}, "the References of the experiment 'one', out.csv, is missing"),
        ({"in.csv": None}, "the Stimuli of the experiment 'one', in.csv, is missing"),
        ({"in.csv": "time,v\n0,1\n"}, "in.csv: the FMU has no input 'v'"),
        ({"in.csv": "time,u\n0,NaN\n"}, "column 'u', row 2"),
        ({"in.csv": "time,u\n0,1\n1\n"}, "row 3 has 1 cells"),
        ({"in.csv": "time,u,u\n0,1,2\n"}, "'u' twice"),
        ({"tests.exp": "<Experiments/>"}, "tests.exp, line 1"),
        ({"tests.exp": "<x xmlns='y'/>"}, "other formats are not read"),
        ({"tests.exp": reference.experiments('stopTime="-1"')}, "correct stopTime"),
        ({"tests.exp": reference.experiments('stepSize="0"')}, "a stepSize is above 0"),
        ({"tests.exp": reference.experiments('stepSize="INF"')}, "expected a finite number"),
        ({"tests.exp": reference.experiments('tolerance="-1"')}, "a tolerance is at least 0"),
        ({"tests.exp": reference.experiments("", '<References source="../../../x"/>')}, "not a place in the FMU"),
        ({"tests.exp": reference.experiments("", '<References source="/etc/passwd"/>')}, "not a place in the FMU"),
        ({"tests.exp": reference.experiments("", '<References source="https://a.b/c"/>')}, "not a place in the FMU"),
        ({"tests.exp": reference.experiments("", '<References source="o.h5" type="application/hdf5"/>')}, "text/csv"),
    ],
)
def test_a_damaged_package_is_refused_before_it_is_run(fmu: Any, changes: Files, told: str) -> None:
    path = fmu(changes)
    with pytest.raises(InputError) as caught:
        verify_fmu(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_too_many_steps_are_refused(fmu: Any) -> None:
    assert "more than" in _failure(fmu({"tests.exp": reference.experiments('stopTime="1e9" stepSize="1e-9"')}))


_SLIPS = st.sampled_from(
    [
        *(
            "",
            " ",
            "x",
            '"',
            "<",
            ">",
            "&",
            ",",
            "\n",
            "\0",
            "\x1b",
            "ä",
            "../",
            "%00",
            "//",
            "]]>",
            "time",
            "u",
            "y[1]",
        ),
        *("nan", "INF", "1e999", "-1", "0", "1_0", "true", "1 2", "9" * 30, "9" * 5000, "x" * 70_000),
    ]
)


@settings(
    max_examples=100,
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(name=st.sampled_from(sorted(_files())), place=st.floats(0.0, 1.0), length=st.integers(0, 8), text=_SLIPS)
def test_files_with_slips_end_in_a_verdict_or_a_message(
    fmu: Any, name: str, place: float, length: int, text: str
) -> None:
    content = _files()[name]
    assert content is not None
    at = int(place * len(content))
    path = fmu({name: content[:at] + text + content[at + length :]})
    try:
        said = verify_fmu(path).reasons
    except InputError as error:
        said = [str(error)]
    for line in said:
        assert line.isprintable(), line
        assert len(line) < 1500


# --- the command --------------------------------------------------------------------------------------------------


def test_the_command_tells_a_table_and_ends_with_the_exit_code_of_the_worst(
    cosim: Cosim, fmu: Any, tmp_path: Path
) -> None:
    sound = fmu().rename(tmp_path / "sound.fmu")
    off = fmu({"out.csv": _OUT.replace("1.5,5.5", "1.5,5.6")}).rename(tmp_path / "off.fmu")
    plain = tmp_path / "plain.fmu"
    ended = cosim("verify", sound)
    assert ended.code == 0
    assert "sound.fmu: verified; variables compared: 5, experiments: 1" in ended.out
    ended = cosim("verify", off)
    assert ended.code == 3
    assert "NOT verified" in ended.out
    line = next(line for line in ended.out.splitlines() if line.split()[:2] == ["one", "y"])
    assert line.split()[2:] == ["0.1", "1.5", "1.05e-08", "DEVIATES"]
    assert ended.err.startswith(f"failed: {off}: experiment 'one': 1 of 5 variables")
    for path, told in ((plain, "no reference experiments"), (tmp_path / "none.fmu", "no such FMU")):
        ended = cosim("verify", path)
        assert ended.code == 2
        assert ended.err.startswith(f"error: {path}: ")
        assert told in ended.err
    assert cosim("verify", sound, plain).code == 2
    ended = cosim("verify", plain, off, sound)
    assert ended.code == 3
    assert "sound.fmu: verified" in ended.out
