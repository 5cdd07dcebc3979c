"""`cosim chart`, `cosim stability`, `cosim tune` and `cosim errors`: studies, which run scenarios many times."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from ..orchestrator.errors import InputError, Interrupted, RunError
from .exit_codes import INTERRUPTED
from .scenario_file import Assignments, ScenarioFile, about, opened, variants

if TYPE_CHECKING:
    from ..orchestrator.results.stored_run import StoredRun
    from ..studies.plan import Variants

Workers = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Run so many points at the same time, on a Dask cluster on this machine; processor seconds are compared "
        "then. Default: one after the other.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="Run the points by the workers of this Dask scheduler, which have to see the same files.",
    ),
]


def chart(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="The study, a YAML file.")],
    output: Annotated[Path | None, typer.Option(help="Folder of the study; default results/<name>.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
) -> None:
    """Chart what settings of a scenario cost against how accurate they are.

    Every point of the study is run once; a study that was interrupted goes on where it stopped.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..studies.bench import Bench
    from ..studies.chart import chart_study, write_chart
    from ..studies.plan import plan_study

    one_of(workers, scheduler)
    plan = plan_study(file, assignments or [])
    folder = output or Path("results") / plan.study.name
    console = Console(stderr=True)
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        charted = chart_study(plan, bench)
        with console.status("drawing the chart"):
            write_chart(charted, folder)
    for note in charted.notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(charted.summary())
    typer.echo(f"  chart in {folder}")


def stability(
    file: Annotated[Path, typer.Argument(metavar="STUDY", help="The study, a YAML file.")],
    output: Annotated[Path | None, typer.Option(help="Folder of the study; default results/<name>.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
) -> None:
    """Map where a scenario is sound over two of its settings, and where it fails, and how.

    With the boundary that a theory predicts, if the study names one. Runs that fail are a result, and the exit code is
    0. A study that was interrupted goes on where it stopped.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..studies.bench import Bench
    from ..studies.stability import map_study, plan_map, write_map
    from ..studies.stability.counts import summary

    one_of(workers, scheduler)
    plan = plan_map(file, assignments or [])
    folder = output or Path("results") / plan.study.name
    console = Console(stderr=True)
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        mapped = map_study(plan, bench)
        with console.status("drawing the map"):
            write_map(mapped, folder)
    for note in mapped.notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(summary(mapped))
    typer.echo(f"  map in {folder}")


def tune(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The scenario, a YAML file.")],
    tolerances: Annotated[
        list[str] | None,
        typer.Option(
            "--tolerance",
            metavar="MEASURE=LIMIT",
            help="The largest error that is allowed, in the measure's unit of measure; may be repeated.",
        ),
    ] = None,
    study: Annotated[
        Path | None,
        typer.Option(help="Choose among the points of this study, and compare with its reference."),
    ] = None,
    mesh: Annotated[bool, typer.Option("--mesh", help="Vary the mesh too, and compare with a finer one.")] = False,
    output: Annotated[
        Path | None, typer.Option(help="Folder of the results; default results/<name>.tune, or the study's.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
) -> None:
    """Find the cheapest setting of a scenario that keeps the tolerances, and write it as a scenario that runs.

    Only what may win is run, and once; a search that was interrupted goes on where it stopped.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.scenario import load_scenario
    from ..studies.bench import Bench
    from ..studies.plan import plan_study
    from ..studies.tuning import parsed_tolerances, summary, tune_scenario, tune_study, write_tuning

    one_of(workers, scheduler)
    limits = parsed_tolerances(tolerances or [])
    if file.suffix.lower() == ".ssp":
        raise InputError(f"{file}: a tuned scenario is written as a YAML file, so tuning begins with one; give that")
    if study is not None and mesh:
        raise InputError("--mesh: a study says by itself what is varied, meshes included; leave --mesh or --study out")
    plan = None if study is None else plan_study(study, assignments or [])
    name = load_scenario(file, assignments or []).name
    folder = output or Path("results") / (f"{name}.tune" if plan is None else plan.study.name)
    console = Console(stderr=True)
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        if plan is None:
            tuning = tune_scenario(file, limits, bench, assignments or [], mesh)
        else:
            tuning = tune_study(plan, file, limits, bench, assignments or [])
        with console.status("drawing the chart"):
            path = write_tuning(tuning, folder)
    for note in tuning.chart.notes:
        typer.echo(f"note: {note}", err=True)
    if path is None:
        raise RunError(f"{summary(tuning)}; all that was run is in {folder / 'tune.csv'}")
    typer.echo(summary(tuning))
    typer.echo(f"  tuned scenario: {path}\n  all that was considered: {folder / 'tune.csv'}")


def errors(
    file: ScenarioFile,
    output: Annotated[Path | None, typer.Option(help="Folder of the budget; default results/<name>.errors.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
) -> None:
    """Tell the numerical error of every number that a scenario gives, and which part of it comes from where.

    The scenario is run as it is, and finer in one source of error at a time: communication step, internal steps, meshes
    and tolerances. A budget that was interrupted goes on where it stopped.
    """
    one_of(workers, scheduler)
    with opened(file, assignments or []) as (scenario, base):
        folder = output or Path("results") / f"{scenario.name}.errors"
        _budget(file, variants(file, assignments or [], scenario, base), folder, workers, scheduler)
    typer.echo(f"  error budget in {folder}")


def append_budget(file: Path, variants: "Variants", folder: Path) -> None:
    """Add the error budget of the run in `folder`, of the scenario in `file`, to that folder."""
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.results.stored_run import StoredRun

    _budget(file, variants, folder, known=StoredRun(folder))


def _budget(
    file: Path,
    variants: "Variants",
    folder: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    known: "StoredRun | None" = None,
) -> None:
    from ..studies.bench import Bench
    from ..studies.budget import error_budget, sentences, write_budget

    # What is wrong with it is said with the file in front.
    variants.scenario({})
    console = Console(stderr=True)
    with resumable(folder), about(file), Bench(folder, console, workers, scheduler) as bench:
        budget = error_budget(variants, bench, known)
        with console.status("drawing the budget"):
            write_budget(budget, folder)
    for note in budget.notes:
        typer.echo(f"note: {note}", err=True)
    for text in sentences(budget):
        typer.echo(f"  {text}")


def one_of(workers: int | None, scheduler: str | None) -> None:
    """InputError where both are given."""
    if workers is not None and scheduler is not None:
        raise InputError("--workers starts workers of its own, and --scheduler has some; give one of the two")


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Say how to go on with a study that a signal stopped."""
    try:
        yield
    except Interrupted as error:
        print(f"interrupted; what is finished is in {folder}, and the same command goes on from there", file=sys.stderr)
        raise typer.Exit(INTERRUPTED + error.signal) from None
