"""`cosim compare` and `cosim sweep`: runs beside one another."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from .completion import STUDIES, files_ending
from .manner import Manner, Quiet, Verbose
from .scenario_file import Assignments, about, opened, variants
from .study_commands import Scheduler, Workers, one_of, resumable


def compare(
    folders: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR DIR...", help="Results folders of runs; the first is what the others are compared with."
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(help="Folder of the comparison; default results/comparison.<names of the folders>."),
    ] = None,
) -> None:
    """Compare runs: their curves over one another, by how much they differ and when, and their hearts side by side.

    Writes comparison.html, a page to open in a browser, and comparison.csv.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.writing import make_folder
    from ..report.comparison.compared import opened as opened_runs
    from ..report.comparison.comparison_page import write_page
    from ..report.comparison.comparison_table import write_table
    from ..report.comparison.differences import differences

    compared = opened_runs(folders)
    folder = output or Path("results") / f"comparison.{'.'.join(Path(name).name for name in compared.runs)}"[:_LONGEST]
    make_folder(folder, "--output")
    found = differences(compared)
    table = write_table(found, folder)
    with Console(stderr=True).status("drawing the comparison"):
        page = write_page(compared, found, folder, f"Comparison of {', '.join(compared.runs)}")
    for note in compared.notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(f"differences: {table}\npage: {page}")


def sweep(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="The scenario, a YAML file.", autocompletion=files_ending(*STUDIES)),
    ],
    varied: Annotated[
        list[str],
        typer.Argument(
            metavar="KEY.PATH=VALUE,VALUE...",
            help="A key of the scenario and its values, e.g. coupling.step_ms=1,2.5,5. With several keys every "
            "combination is run.",
        ),
    ],
    output: Annotated[Path | None, typer.Option(help="The folder of the sweep. Default: results/<name>.sweep.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Run a scenario with every combination of some values and show the runs together.

    Writes sweep.csv, a row per run, and sweep.html, a page to open in a browser. Every variant is run once; a sweep
    that was interrupted continues where it stopped, and one to which values are added runs only the new ones.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..report.comparison.sweep_files import write_sweep
    from ..studies.bench import Bench
    from ..studies.sweep import plan_sweep, run_sweep, varied_values

    one_of(workers, scheduler)
    manner = Manner(quiet, verbose)
    values = varied_values(varied)
    with opened(file, assignments or []) as (scenario, base):
        planned = plan_sweep(variants(file, assignments or [], scenario, base), values)
        folder = output or Path("results") / f"{scenario.name}.sweep"
        console = manner.progress_console
        with resumable(folder), about(file), Bench(folder, console, workers, scheduler) as bench:
            swept = run_sweep(planned, bench)
            with console.status("drawing the sweep"):
                table, page = write_sweep(swept, folder, scenario.name)
    done = sum(each.status == "done" for each in swept)
    manner.say(f"{scenario.name}: {done} of {len(swept)} variants ran to their end\n  table: {table}\n  page: {page}")


#: Characters of a folder's name.
_LONGEST = 120
