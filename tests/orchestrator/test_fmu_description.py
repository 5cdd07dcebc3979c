"""If these fail, the master does not see what an FMU of FMI 3.0 says it can do, and couples it worse than it could."""

import zipfile
from pathlib import Path

from cardiac_cosim.orchestrator.participants.fmu_description import read_description
from cardiac_cosim.orchestrator.participants.fmu_file import FmuFile


def test_inputs_that_may_change_inside_a_step_are_seen(tmp_path: Path) -> None:
    # FMPy 0.3.32 does not read the attribute: linear inputs would be held, without a word.
    variables = "".join(
        f'<Float64 name="{name}" valueReference="{number}" causality="input" start="0" {attribute}/>'
        for number, (name, attribute) in enumerate(
            (("u", 'intermediateUpdate="true"'), ("v", 'intermediateUpdate="1"'), ("w", 'intermediateUpdate="false"'))
        )
    )
    text = (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><CoSimulation modelIdentifier="m" '
        f'providesIntermediateUpdate="true"/><ModelVariables>{variables}</ModelVariables><ModelStructure/>'
        "</fmiModelDescription>"
    )
    path = tmp_path / "m.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
    description = read_description(FmuFile(path))
    assert description.coSimulation.canInterpolateInputs
    assert [variable.intermediateUpdate for variable in description.modelVariables] == [True, True, False]
