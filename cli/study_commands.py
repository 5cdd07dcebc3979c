"""`cosim chart`, `cosim stability`, `cosim tune` and `cosim errors`: studies, which run scenarios many times."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..orchestrator.errors import InputError, Interrupted, RunError
from ..orchestrator.results.names import PAGE
from .completion import STUDIES, files_ending
from .exit_codes import INTERRUPTED
from .manner import Manner, Quiet, Verbose
from .scenario_file import Assignments, ScenarioFile, about, opened, variants

if TYPE_CHECKING:
    from ..orchestrator.results.stored_run import StoredRun
    from ..studies.plan import Variants

StudyFile = Annotated[
    Path,
    typer.Argument(metavar="STUDY", help="The study, a YAML file.", autocompletion=files_ending(*STUDIES)),
]
Workers = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="How many points are run at the same time, by processes on this machine; costs are compared in processor "
        "seconds then. Default: the points are run one after the other.",
    ),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        help="The address of a Dask scheduler by whose workers the points are run; they have to see the same files.",
    ),
]


def chart(
    file: StudyFile,
    output: Annotated[Path | None, typer.Option(help="The folder of the study. Default: results/<name>.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Chart what the settings of a scenario cost against how accurate they are.

    Every point of the study is run once. The same command continues a study that was interrupted.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..studies.bench import Bench
    from ..studies.chart import chart_study, write_chart
    from ..studies.plan import plan_study

    one_of(workers, scheduler)
    manner = Manner(quiet, verbose)
    plan = plan_study(file, assignments or [])
    folder = output or Path("results") / plan.study.name
    console = manner.progress_console
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        charted = chart_study(plan, bench)
        with console.status("drawing the chart"):
            write_chart(charted, folder)
    for note in charted.notes:
        manner.note(note)
    manner.say(charted.summary())
    manner.say(f"  chart in {folder}")


def stability(
    file: StudyFile,
    output: Annotated[Path | None, typer.Option(help="The folder of the study. Default: results/<name>.")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Map over two of its settings where a scenario is sound, and where and how it fails.

    If the study names a theory, the map has the boundary that this predicts. Runs that fail are results too: the exit
    code is 0. The same command continues a study that was interrupted.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..studies.bench import Bench
    from ..studies.stability import map_study, plan_map, write_map
    from ..studies.stability.counts import summary

    one_of(workers, scheduler)
    manner = Manner(quiet, verbose)
    plan = plan_map(file, assignments or [])
    folder = output or Path("results") / plan.study.name
    console = manner.progress_console
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        mapped = map_study(plan, bench)
        with console.status("drawing the map"):
            write_map(mapped, folder)
    for note in mapped.notes:
        manner.note(note)
    manner.say(summary(mapped))
    manner.say(f"  map in {folder}")


def tune(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="The scenario, a YAML file.", autocompletion=files_ending(*STUDIES)),
    ],
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
        typer.Option(
            help="Choose among the points of this study, and compare with its reference.",
            autocompletion=files_ending(*STUDIES),
        ),
    ] = None,
    mesh: Annotated[bool, typer.Option("--mesh", help="Vary the mesh as well, and compare with a finer one.")] = False,
    output: Annotated[
        Path | None, typer.Option(help="The folder of the results. Default: results/<name>.tune, or that of the study.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Find the cheapest setting of a scenario that keeps given tolerances, and write it as a scenario file.

    Only settings that may be the cheapest are run, each once. The same command continues a search that was interrupted.
    """
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.scenario import load_scenario
    from ..studies.bench import Bench
    from ..studies.plan import plan_study
    from ..studies.tuning import parsed_tolerances, summary, tune_scenario, tune_study, write_tuning

    one_of(workers, scheduler)
    manner = Manner(quiet, verbose)
    limits = parsed_tolerances(tolerances or [])
    if file.suffix.lower() == ".ssp":
        raise InputError(f"{file}: a tuned scenario is written as a YAML file, so tuning begins with one; give that")
    if study is not None and mesh:
        raise InputError("--mesh: a study says by itself what is varied, meshes included; leave --mesh or --study out")
    plan = None if study is None else plan_study(study, assignments or [])
    name = load_scenario(file, assignments or []).name
    folder = output or Path("results") / (f"{name}.tune" if plan is None else plan.study.name)
    console = manner.progress_console
    with resumable(folder), Bench(folder, console, workers, scheduler) as bench:
        if plan is None:
            tuning = tune_scenario(file, limits, bench, assignments or [], mesh)
        else:
            tuning = tune_study(plan, file, limits, bench, assignments or [])
        with console.status("drawing the chart"):
            path = write_tuning(tuning, folder)
    for note in tuning.chart.notes:
        manner.note(note)
    if path is None:
        raise RunError(f"{summary(tuning)}; all that was run is in {folder / 'tune.csv'}")
    manner.say(summary(tuning))
    manner.say(f"  tuned scenario: {path}\n  all that was considered: {folder / 'tune.csv'}")


def errors(
    file: ScenarioFile,
    output: Annotated[
        Path | None, typer.Option(help="The folder of the error budget. Default: results/<name>.errors.")
    ] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    assignments: Assignments = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Estimate the numerical error of every result of a scenario, and how much of it each source contributes.

    The scenario is run as it is, and again with one source of error refined at a time: communication step, internal
    steps, meshes and tolerances. The same command continues a budget that was interrupted.
    """
    one_of(workers, scheduler)
    manner = Manner(quiet, verbose)
    with opened(file, assignments or []) as (scenario, base):
        folder = output or Path("results") / f"{scenario.name}.errors"
        _budget(file, variants(file, assignments or [], scenario, base), folder, manner, workers, scheduler)
    manner.say(f"  error budget in {folder}")


def append_budget(file: Path, variants: "Variants", folder: Path, manner: Manner) -> None:
    """Add the error budget of the run in `folder`, of the scenario in `file`, to that folder."""
    # Imported here, so that help does not wait for numerical libraries.
    from ..orchestrator.results.stored_run import StoredRun

    _budget(file, variants, folder, manner, known=StoredRun(folder))
    if (folder / PAGE).exists():
        # Its headline numbers have errors now.
        from ..report.page import write_page

        write_page(folder)


def _budget(
    file: Path,
    variants: "Variants",
    folder: Path,
    manner: Manner,
    workers: int | None = None,
    scheduler: str | None = None,
    known: "StoredRun | None" = None,
) -> None:
    from ..studies.bench import Bench
    from ..studies.budget import error_budget, sentences, write_budget

    # What is wrong with it is said with the file in front.
    variants.scenario({})
    console = manner.progress_console
    with resumable(folder), about(file), Bench(folder, console, workers, scheduler) as bench:
        budget = error_budget(variants, bench, known)
        with console.status("drawing the budget"):
            write_budget(budget, folder)
    for note in budget.notes:
        manner.note(note)
    for text in sentences(budget):
        manner.say(f"  {text}")


def one_of(workers: int | None, scheduler: str | None) -> None:
    """InputError where both are given."""
    if workers is not None and scheduler is not None:
        raise InputError(
            "--workers starts processes on this machine, --scheduler uses those of a cluster; give one of the two"
        )


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Say how to go on with a study that a signal stopped."""
    try:
        yield
    except Interrupted as error:
        print(
            f"interrupted; the finished runs are in {folder}, and the same command continues from there",
            file=sys.stderr,
        )
        raise typer.Exit(INTERRUPTED + error.signal) from None
