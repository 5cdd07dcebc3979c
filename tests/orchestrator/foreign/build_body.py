"""Builds the FMU of body.c with the C compiler of the machine."""

import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import fmpy

_GUID = "{0d7a3f2e-body}"
_VARIABLES = (
    [(name, "parameter", "fixed", f'start="{start}"') for name, start in (("m", 1), ("k", 0), ("c", 0))]
    + [(name, "parameter", "fixed", 'start="0"') for name in ("k_c", "c_c")]
    + [(name, "input", "continuous", 'start="0"') for name in ("F_in", "x_in", "v_in")]
    + [(name, "output", "continuous", 'start="0"') for name in ("x", "v")]
    + [("F", "output", "continuous", "")]
)


def compiler() -> str | None:
    """A C compiler, if the machine has one."""
    return shutil.which("cc") or shutil.which("gcc")


def build_body(
    path: Path, state: bool = True, variable_step: bool = True, ramps: bool = True, quirk: str = "0"
) -> Path:
    """Write the FMU to `path`, with or without what an FMU need not be able to do; `quirk` is a name in body.c."""
    folder = path.parent / f"{path.stem}-build"
    folder.mkdir()
    library = folder / f"body{sysconfig.get_config_var('SHLIB_SUFFIX') or '.so'}"
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [str(compiler()), "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-I{headers}", f'-DGUID="{_GUID}"']
    command += [f"-DQUIRK={quirk}", *(["-DWITH_STATE"] if state else [])]
    source = Path(__file__).with_name("body.c")
    subprocess.run([*command, str(source), "-o", str(library), "-lm"], check=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _description(state, variable_step, ramps))
        archive.write(library, f"binaries/{'linux64' if sys.platform == 'linux' else 'darwin64'}/{library.name}")
    return path


def _description(state: bool, variable_step: bool, ramps: bool) -> str:
    yes = {True: "true", False: "false"}
    lines = []
    for reference, (name, causality, variability, start) in enumerate(_VARIABLES):
        initial = {"parameter": ' initial="exact"', "output": ' initial="exact"' if start else ' initial="calculated"'}
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"{initial.get(causality, "")}><Real {start}/></ScalarVariable>'
        )
    outputs = "".join(f'<Unknown index="{number}"/>' for number in (9, 10, 11))
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="body" guid="{_GUID}">'
        f'<CoSimulation modelIdentifier="body" canHandleVariableCommunicationStepSize="{yes[variable_step]}" '
        f'canInterpolateInputs="{yes[ramps]}" canGetAndSetFMUstate="{yes[state]}" canSerializeFMUstate="{yes[state]}"/>'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs>"
        '<InitialUnknowns><Unknown index="11"/></InitialUnknowns></ModelStructure></fmiModelDescription>'
    )
