"""The command `cosim`."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from .errors import InputError, Interrupted, RunError
from .scenario import Scenario, load_scenario

#: Exit codes; 1 is left for what should not happen, an exception nobody expected.
INPUT_WRONG = 2
RUN_FAILED = 3
#: Added to the number of the signal that stopped a run, as shells do: 130 after Ctrl-C.
INTERRUPTED = 128

app = typer.Typer(
    help="A beating two-chamber heart as FMI co-simulation of exchangeable physics units.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

ScenarioFile = Annotated[Path, typer.Argument(metavar="FILE", help="The scenario, a YAML file.")]
Assignments = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.PATH=VALUE", help="Change a key of the scenario; may be repeated."),
]


@app.command()
def run(
    file: ScenarioFile,
    output: Annotated[Path | None, typer.Option(help="Results folder; default results/<name>.")] = None,
    assignments: Assignments = None,
    participants: Annotated[
        str | None,
        typer.Option(metavar="native|fmu", help="Call the units directly, or through FMUs (default)."),
    ] = None,
    fmu_dir: Annotated[Path | None, typer.Option(help="Where FMUs are built; default: a user cache.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last checkpoint in the results folder, if there is one.")
    ] = False,
    figures: Annotated[bool, typer.Option(help="Draw the figures when the run is done.")] = True,
) -> None:
    """Run a scenario and write time series, fields, coupling log, summary and figures."""
    # Imported here, so that help and errors in the scenario do not wait for plotting and FMI libraries.
    from .results.figures import draw_figures
    from .run import run_scenario

    overrides = [*(assignments or []), *([f"run.participants={participants}"] if participants else [])]
    scenario = load_scenario(file, overrides)
    folder = output if output is not None else Path("results") / scenario.name
    console = Console(stderr=True)
    with _about(file):
        try:
            outcome = run_scenario(scenario, file.parent, folder, console, fmu_dir, resume)
        except Interrupted as error:
            print(f"interrupted; the results so far are in {folder}, to be continued with --resume", file=sys.stderr)
            raise typer.Exit(INTERRUPTED + error.signal) from None
    if figures:
        with console.status("drawing the figures"):
            draw_figures(outcome.folder)
    _report(scenario, outcome.folder, outcome.summary)


@app.command()
def build(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option(help="Where the FMUs go.")] = Path("fmus-built"),
    assignments: Assignments = None,
) -> None:
    """Build the FMU of every unit in a scenario: one <unit name>.fmu each, on the scenario's mesh."""
    from shutil import copyfile
    from tempfile import TemporaryDirectory

    from .participants.native import fmu_of_unit
    from .run import checked_mesh, make_folder

    scenario = load_scenario(file, assignments or [])
    with _about(file):
        mesh = checked_mesh(scenario, file.parent)
        if mesh is None:
            raise InputError("there is no unit to build; every participant is an FMU already")
        make_folder(output, "--output")
    with TemporaryDirectory(prefix="cosim-") as folder:
        for unit in dict.fromkeys(entry.unit for entry in scenario.units.values() if entry.unit is not None):
            built = fmu_of_unit(unit, mesh, Path(folder))
            typer.echo(copyfile(built, output / built.name))


@app.command()
def show(file: ScenarioFile, assignments: Assignments = None) -> None:
    """Say what a scenario builds, exchanges and solves, and what it does without; nothing is run."""
    from .run import show_scenario

    scenario = load_scenario(file, assignments or [])
    with _about(file):
        typer.echo(show_scenario(scenario, file.parent))


@contextmanager
def _about(file: Path) -> Iterator[None]:
    """Put the scenario file in front of what is wrong with its content."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{file}: {error}") from None


def _report(scenario: Scenario, folder: Path, summary: dict[str, Any]) -> None:
    wall = summary["wall_s"]
    lines = [f"{scenario.name}: {summary['steps']} steps to {summary['end_ms']:g} ms in {wall['total']:.1f} s"]
    for probe, activation in summary["activation_time_ms"].items():
        lines.append(f"  activation at {probe}: {'none' if activation is None else f'{activation:.1f} ms'}")
    for chamber, fraction in summary["ejection_fraction"].items():
        volume = summary[f"{chamber}_volume_ml"]
        lines.append(
            f"  {chamber} volume: {volume['start']:.2f} -> {volume['min']:.2f} ml, ejection fraction {fraction:.2f}"
        )
    lines.append(f"  results in {folder}")
    typer.echo("\n".join(lines))
    late = summary["unconverged_ms"]
    if late:
        typer.echo(
            f"warning: {len(late)} of {summary['steps']} steps were accepted without having converged, the first at "
            f"{late[0]:g} ms; see the residuals in {folder / 'coupling.csv'}",
            err=True,
        )


def main() -> None:
    """Entry point: exit code 0 done, 2 the input is wrong, 3 the run failed, 128 + signal when stopped; 1 is a bug."""
    try:
        app()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(INPUT_WRONG)
    except RunError as error:
        print(f"failed: {error}", file=sys.stderr)
        sys.exit(RUN_FAILED)


if __name__ == "__main__":
    main()
