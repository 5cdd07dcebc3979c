"""Builds the FMU of active_stress.c for a mesh of so many nodes, with the C compiler of the machine."""

import subprocess
import zipfile
from pathlib import Path

import fmpy

_GUID = "{0d7a3f2e-muscle}"
#: Parameters by the names that our unit has for them, in the order of their value references.
_PARAMETERS = {
    "tension_per_potential_MPa_per_mV": 0.005,
    "tension_rest_potential_mV": -80.0,
    "tension_threshold_potential_mV": 0.0,
    "slow_rate_per_ms": 0.1,
    "fast_rate_per_ms": 1.0,
    "delay_slope_per_mV": 1.0,
}


def build_active_stress(path: Path, nodes: int) -> Path:
    """Write the FMU to `path`."""
    library = path.with_name("muscle.so")
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"-I{headers}", f'-DGUID="{_GUID}"']
    source = Path(__file__).with_name("active_stress.c")
    subprocess.run([*command, f"-DNODES={nodes}", str(source), "-o", str(library), "-lm"], check=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _description(nodes))
        archive.write(library, f"binaries/linux64/{library.name}")
    return path


def _description(nodes: int) -> str:
    numbers = range(1, nodes + 1)
    variables = [
        *((name, "parameter", "fixed", f'start="{start}"') for name, start in _PARAMETERS.items()),
        *((f"potential[{number}]", "input", "continuous", 'unit="mV" start="-80"') for number in numbers),
        *((f"active_stress[{number}]", "output", "continuous", 'unit="kPa"') for number in numbers),
        *((f"active_stress_{kind}", "output", "continuous", 'unit="kPa"') for kind in ("mean", "max")),
    ]
    scalars = "".join(
        f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
        f'variability="{variability}"><Real {rest}/></ScalarVariable>'
        for reference, (name, causality, variability, rest) in enumerate(variables)
    )
    unknowns = "".join(f'<Unknown index="{len(_PARAMETERS) + nodes + number}"/>' for number in range(1, nodes + 3))
    units = "".join(f'<Unit name="{name}"/>' for name in ("mV", "kPa"))
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><fmiModelDescription fmiVersion="2.0" modelName="muscle" '
        f'guid="{_GUID}" variableNamingConvention="structured">'
        '<CoSimulation modelIdentifier="muscle" canHandleVariableCommunicationStepSize="true" '
        'canGetAndSetFMUstate="true" canSerializeFMUstate="true"/>'
        f"<UnitDefinitions>{units}</UnitDefinitions><ModelVariables>{scalars}</ModelVariables>"
        f"<ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>"
        "</fmiModelDescription>"
    )
