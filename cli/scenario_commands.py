"""`cosim run`, `cosim build` and `cosim show`."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ..orchestrator.errors import InputError, Interrupted, RunError
from ..orchestrator.results.names import PAGE
from ..orchestrator.scenario import Scenario, parsed_assignments
from .exit_codes import INTERRUPTED
from .manner import Manner, Quiet, Verbose
from .scenario_file import Assignments, ScenarioFile, about, opened, variants


def run(
    file: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option(
            help="The results folder. Default: results/<name>, or, where that has results of other settings, a folder "
            "beside it whose name says how they differ."
        ),
    ] = None,
    assignments: Assignments = None,
    participants: Annotated[
        str | None,
        typer.Option(
            metavar="native|fmu|fmu3",
            help="How units are called: as FMUs of FMI 2.0 (fmu, the default) or FMI 3.0 (fmu3), or directly, without "
            "FMI (native). The results are the same to the last bit.",
        ),
    ] = None,
    fmu_dir: Annotated[
        Path | None, typer.Option(help="The folder in which FMUs are built and kept. Default: the user's cache.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue from the last checkpoint in the results folder, if there is one.")
    ] = False,
    figures: Annotated[bool, typer.Option(help="Draw figures when the run has ended.")] = True,
    report: Annotated[
        bool, typer.Option(help="Write the report, report.html, a page to open in a browser, when the run has ended.")
    ] = True,
    error_budget: Annotated[
        bool,
        typer.Option(
            "--error-budget",
            help="Afterwards run finer variants as well, and estimate the numerical error of every result.",
        ),
    ] = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run a scenario, and write its time series, fields, coupling log, summary, figures and report."""
    # Imported here, so that help and errors in the scenario do not wait for numerical and FMI libraries.
    from ..orchestrator.results.request import Request
    from ..orchestrator.run import run_scenario
    from ..report import presentation

    manner = Manner(quiet, verbose)
    overrides = [*(assignments or []), *([f"run.participants={participants}"] if participants else [])]
    with opened(file, overrides) as (scenario, base):
        folder = output if output is not None else _default_folder(scenario, resume, manner)
        with about(file):
            try:
                request = Request(str(file), parsed_assignments(overrides))
                wanted = {presentation.FIGURES: figures, presentation.PAGE: report}
                parts = tuple(part for part in wanted if wanted[part])
                shown = presentation.Presentation(folder, scenario.name, request.settings, parts) if parts else None
                outcome = run_scenario(
                    scenario, base, folder, manner.console, fmu_dir, resume, shown, request, progress=not quiet
                )
            except Interrupted as error:
                rest = "; continue with --resume" if error.resumable else "; no checkpoint was kept to continue from"
                print(f"interrupted; the results so far are in {folder}{rest}", file=sys.stderr)
                raise typer.Exit(INTERRUPTED + error.signal) from None
            except RunError:
                # What failed is said last.
                if (folder / PAGE).is_file():
                    manner.note(f"to look at the results up to the failure, open {folder / PAGE} in a browser")
                raise
        for warning in outcome.warnings:
            _warn(warning)
        _report(scenario, outcome.folder, outcome.summary, manner)
        if error_budget:
            # Imported here, because most runs do not need it.
            from .study_commands import append_budget

            append_budget(file, variants(file, overrides, scenario, base), folder, manner)


def build(
    file: ScenarioFile,
    output: Annotated[Path, typer.Option(help="The folder for the FMUs.")] = Path("fmus-built"),
    assignments: Assignments = None,
    ssp: Annotated[
        bool,
        typer.Option(
            "--ssp",
            help="Also write a system package, <name>.ssp, of SSP 1.0, or with --fmi 3 of SSP 2.0, in which a field "
            "is one connection.",
        ),
    ] = False,
    osp: Annotated[
        bool, typer.Option("--osp", help="Also write the system structure for libcosim (FMI 2.0 only).")
    ] = False,
    container: Annotated[
        bool,
        typer.Option(
            "--container", help="Also write the description by which fmucontainer makes one FMU of all (FMI 2.0 only)."
        ),
    ] = False,
    fmi: Annotated[
        int, typer.Option("--fmi", min=2, max=3, help="The version of FMI. In FMI 3.0 a field is one array.")
    ] = 2,
) -> None:
    """Build an FMU of every unit in a scenario, <unit name>.fmu, for the mesh of that scenario."""
    from ..orchestrator.build import build_fmus, write_container_file, write_osp_files, write_package
    from ..orchestrator.scene_warnings import scene_warnings

    with opened(file, assignments or []) as (scenario, base), about(file):
        if fmi == 3 and (osp or container):
            raise InputError("--osp and --container are for FMUs of FMI 2.0; leave --fmi 3 out")
        built = build_fmus(scenario, base, output, may_be_none=ssp or osp or container, fmi=fmi)
        for text in scene_warnings(scenario, built.mesh):
            _warn(text)
        for path in built.fmus.values():
            typer.echo(path)
        if ssp:
            typer.echo(write_package(built))
        if osp:
            typer.echo(write_osp_files(built))
        if container:
            path = write_container_file(built)
            typer.echo(f"{path}\nnow: fmucontainer -fmu-directory {output} -container {path.name}")


def show(
    file: ScenarioFile,
    assignments: Assignments = None,
    graph: Annotated[
        Path | None,
        typer.Option(
            metavar="PICTURE",
            help="Instead of the text, draw a picture of the units, the fields between them, the loops and the "
            "execution order, into a file that ends in .svg, .png or .pdf.",
        ),
    ] = None,
    parameters: Annotated[
        bool,
        typer.Option(
            "--parameters",
            help="Instead of the text, list the units' parameters with values, defaults, units of measure and limits.",
        ),
    ] = False,
) -> None:
    """Show what a scenario would build, exchange, solve and omit, without running it."""
    from ..orchestrator.showing import assembled, describe, graph_of, parameter_table

    with opened(file, assignments or []) as (scenario, base), about(file), assembled(scenario, base) as assembly:
        if parameters:
            typer.echo(parameter_table(scenario))
        if graph is not None:
            # Imported here, because it takes a while, and nothing else needs it.
            from ..orchestrator.showing.graph_picture import write_graph

            write_graph(graph_of(assembly), graph)
            typer.echo(f"graph in {graph}")
        if graph is None and not parameters:
            typer.echo(describe(assembly))


def _default_folder(scenario: Scenario, resume: bool, manner: Manner) -> Path:
    """Where results go when nobody says so, which is told before anything is computed."""
    from ..orchestrator.results.default_folder import RESULTS, default_folder

    folder = default_folder(scenario, resume)
    plain = RESULTS / scenario.name
    manner.say(f"results go to {folder}" + (f", because {plain} has other results" if folder != plain else ""))
    return folder


def _report(scenario: Scenario, folder: Path, summary: dict[str, Any], manner: Manner) -> None:
    wall = summary["wall_s"]
    lines = [f"{scenario.name}: {summary['steps']} steps to {summary['end_ms']:g} ms in {wall['total']:.1f} s"]
    for probe, activation in summary["activation_time_ms"].items():
        lines.append(f"  activation at {probe}: {'none' if activation is None else f'{activation:.1f} ms'}")
    for chamber, fraction in summary["ejection_fraction"].items():
        volume = summary[f"{chamber}_volume_ml"]
        ejects = volume["min"] < volume["start"]
        then = f"{volume['min']:.2f} ml, ejection fraction {fraction:.2f}" if ejects else f"{volume['max']:.2f} ml"
        lines.append(f"  {chamber} volume: {volume['start']:.2f} -> {then}")
    lines.append(f"  results in {folder}")
    if (folder / PAGE).is_file():
        lines.append(f"  to look at them, open {folder / PAGE} in a browser")
    manner.say("\n".join(lines))
    late, missed = summary["unconverged_ms"], summary["tolerance_missed"]
    if late:
        _warn(
            f"{len(late)} of {summary['steps']} steps were accepted without having converged, the first at "
            f"{late[0]:g} ms; see the residuals in {folder / 'coupling.csv'}"
        )
    if missed["steps"]:
        _warn(
            f"{missed['steps']} of {summary['steps']} steps missed the tolerance of coupling.adaptive, because none is "
            f"shorter than min_ms, the first at {missed['first_ms']:g} ms; see the column `error` in "
            f"{folder / 'coupling.csv'}, and lower `min_ms` or raise `tolerance`"
        )


def _warn(text: str) -> None:
    typer.echo(f"warning: {text}", err=True)
