"""`cosim verify`: FMUs checked by the reference experiments in them."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..orchestrator.errors import InputError, RunError
from ..orchestrator.quoting import shortened
from .completion import FMUS, files_ending
from .exit_codes import INPUT_WRONG

if TYPE_CHECKING:
    from ..orchestrator.verification import Outcome, Verification

_HEAD = ("experiment", "variable", "largest deviation", "at [s]", "allowed", "verdict")


def verify(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FMU...",
            help="FMUs of FMI 2.0 or 3.0, from any tool.",
            autocompletion=files_ending(*FMUS),
        ),
    ],
) -> None:
    """Repeat the reference experiments that FMUs contain (FMI-LS-REF), and compare with the results stored there.

    Exit code 0: all results are within their tolerance. 2: a file is no FMU, or its reference experiments are missing
    or damaged. 3: an experiment deviates from its stored results, or the FMU failed.
    """
    # Imported here, so that help does not wait for numerical and FMI libraries.
    from ..orchestrator.verification import verify_fmu

    reasons: list[str] = []
    wrong: list[InputError] = []
    for file in files:
        try:
            verification = verify_fmu(file)
        except InputError as error:
            if len(files) == 1:
                raise
            wrong.append(error)
            typer.echo(f"error: {error}", err=True)
            continue
        _tell(file, verification)
        reasons += [f"{file}: {reason}" for reason in verification.reasons]
    if reasons:
        raise RunError("\nfailed: ".join(reasons))
    if wrong:
        raise typer.Exit(INPUT_WRONG)


def _tell(file: Path, verification: "Verification") -> None:
    compared = sum(outcome.compared for outcome in verification.outcomes)
    of_all = sum(len(outcome.comparisons) for outcome in verification.outcomes)
    kind = "verified" if verification.is_verified else "NOT verified"
    typer.echo(
        f"{file}: {kind}; variables compared: {compared}{f' of {of_all}' if compared < of_all else ''}, experiments: "
        f"{len(verification.outcomes)}"
    )
    rows = [row for outcome in verification.outcomes for row in _rows(outcome)]
    for line in _aligned([_HEAD, *rows]):
        typer.echo(f"  {line}")
    for note in verification.notes:
        typer.echo(f"note: {file}: {note}", err=True)


def _rows(outcome: "Outcome") -> Iterable[Sequence[str]]:
    if outcome.failure is not None:
        yield outcome.experiment, "-", "-", "-", "-", "FAILED"
    elif not outcome.comparisons:
        yield outcome.experiment, "-", "-", "-", "-", "nothing compared"
    for item in outcome.comparisons:
        numbers = (_number(item.deviation), _number(item.time_s, 6), _number(item.allowed))
        yield outcome.experiment, shortened(item.variable), *numbers, item.verdict.value


def _number(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}g}"


def _aligned(rows: Sequence[Sequence[str]]) -> Iterable[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
