"""The check of one experiment: what it is run with, the run, and what comes of it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..participants.fmu import FmuParticipant
from ..participants.fmu_description import Description
from ..participants.participant import Parameters, Port
from ..quoting import shortened
from .communication import communication
from .experiment import Experiment
from .outcome import Comparison, Outcome, Verdict
from .parameter_set import read_parameter_set
from .reference_files import ReferenceFiles
from .rerun import rerun
from .results import Expected, read_results
from .stimuli import Stimulus, stimuli
from .table import ValueTable, read_values
from .unverified import Unverified

#: Types that this master does not read.
_UNREAD = ("Binary", "Clock")

#: Types that FMI 2.0 does not have, as the names of variables begin with them in the Reference-FMUs' Feedthrough.
_NEWER = ("Float32_", "Int8_", "UInt8_", "Int16_", "UInt16_", "UInt32_", "Int64_", "UInt64_", "Binary_", "Clock_")

#: Names that a note repeats.
_MOST = 10


class Check:
    """The check of `experiment` in the FMU at `path`; what is left out is told to `tell`.

    InputError where its parameter set or its stimuli are damaged or do not fit the FMU.
    """

    def __init__(
        self,
        path: Path,
        experiment: Experiment,
        files: ReferenceFiles,
        description: Description,
        tell: Callable[[str], None],
    ) -> None:
        self._path, self._experiment, self._files, self._tell = path, experiment, files, tell
        self._version = description.fmiVersion
        self._types = {variable.name: variable.type for variable in description.modelVariables}
        self._parameters, self._start = self._parameter_set(description)
        # This one runs nothing of the FMU's code.
        self._declared = self._participant(loaded=False)
        self._stimuli = self._read_stimuli()

    def outcome(self) -> Outcome:
        """Run the experiment and compare it with its results; a failure is part of the outcome."""
        name = self._experiment.name
        try:
            if self._experiment.references is None:
                return self._only_run()
            table = read_results(self._files.read(self._experiment.references), self._experiment.references)
            ports = self._ports(table)
            left = self._left_out([column for column in table.columns if column not in ports])
            expected = {column: Expected.of(column, table.columns[column], port) for column, port in ports.items()}
            found = self._compared(table.times, expected)
            if not found:
                return Outcome(name, left, "the FMU has none of the variables in its results that can be compared")
            return Outcome(name, (*found, *left))
        except Unverified as error:
            return Outcome(name, failure=str(error))

    def _only_run(self) -> Outcome:
        name, stop = self._experiment.name, self._experiment.stop_s
        if stop is None:
            self._tell(f"the experiment '{name}' has no results and no stopTime; it is not run")
        else:
            self._tell(f"the experiment '{name}' has no results; it is run, and nothing is compared")
            self._compared(np.array([self._experiment.start_s, stop]), {})
        return Outcome(name)

    def _compared(self, times: NDArray[np.float64], expected: Mapping[str, Expected]) -> tuple[Comparison, ...]:
        plan = communication(self._experiment, times)
        observe = [column for column in expected if not self._declared.outputs.known(column)]
        try:
            participant = self._participant(observe=observe)
        except InputError as error:
            # All that its files say was found in order before.
            raise Unverified(f"the FMU cannot be started: {error}") from None
        try:
            values = rerun(participant, self._stimuli, expected, plan)
        finally:
            participant.close()
        tolerance = self._experiment.tolerance
        return tuple(item.compared(times, values[column], tolerance) for column, item in expected.items())

    def _ports(self, table: ValueTable) -> dict[str, Port]:
        """The variables in the results that the FMU has and that can be read, by name."""
        outputs = self._declared.outputs
        found = {column: outputs[column] for column in table.columns if outputs.known(column)}
        if len(found) == len(table.columns):
            return found
        # All others that there are, inputs and locals for example.
        others = self._participant(observe=["*"], loaded=False).observed
        known = (column for column in table.columns if column not in found and others.known(column))
        return found | {column: others[column] for column in known}

    def _left_out(self, columns: Sequence[str]) -> tuple[Comparison, ...]:
        """The verdicts on columns that are compared with nothing."""
        unread = [column for column in columns if self._types.get(column) in _UNREAD]
        newer = [column for column in columns if self._is_newer(column)]
        if unread:
            self._tell(f"this master does not read variables of type Binary or Clock: {_listed(unread)}")
        if newer:
            self._tell(f"the results are those of FMI 3.0 too; FMI 2.0 does not have the types of: {_listed(newer)}")
        left = {*unread, *newer}
        return tuple(Comparison(column, Verdict.LEFT_OUT if column in left else Verdict.LACKING) for column in columns)

    def _is_newer(self, column: str) -> bool:
        return (
            self._experiment.is_alone
            and self._version == "2.0"
            and column not in self._types
            and column.startswith(_NEWER)
        )

    def _participant(self, **how: Any) -> FmuParticipant:
        """The FMU as a participant of the master; InputError without the file, which the caller knows."""
        name = self._path.stem
        try:
            return FmuParticipant(
                name, self._path, self._parameters, self._start, start_s=self._experiment.start_s, **how
            )
        except InputError as error:
            raise InputError(str(error).removeprefix(f"unit '{name}': {self._path}: ")) from None

    def _parameter_set(self, description: Description) -> tuple[Parameters, Parameters]:
        name = self._experiment.parameters
        if name is None:
            return {}, {}
        try:
            return read_parameter_set(self._files.read(name), description, self._tell)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None

    def _read_stimuli(self) -> list[Stimulus]:
        name = self._experiment.stimuli
        if name is None:
            return []
        try:
            return stimuli(read_values(self._files.read(name)), self._declared.inputs)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None


def _listed(names: Sequence[str]) -> str:
    return ", ".join(shortened(name) for name in names[:_MOST]) + (", ..." if len(names) > _MOST else "")
