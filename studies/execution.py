"""A point, run in a worker that keeps what does not change from one point to the next: imports, meshes, caches."""

import json
import threading
from collections.abc import Hashable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory, mkdtemp

from ..orchestrator.assembly import check_units, checked_mesh
from ..orchestrator.errors import InputError, RunError
from ..orchestrator.participants.native import Mesh
from ..orchestrator.participants.unpacked import keep_unpacked
from ..orchestrator.results.stored_run import StoredRun
from ..orchestrator.run import run_scenario
from ..orchestrator.scenario import Scenario
from .trial import BUG, DONE, FAILED, REFUSED, Cost, Trial

#: A run shorter than this, in seconds, is repeated, so often in all.
_SHORT_S, _RUNS = 1.0, 3

#: Meshes that a worker keeps.
_MESHES = 4

#: Points share nothing with each other: each has its process to itself.
_busy = threading.Lock()

#: What this process has run before: scene, units and the way they are called.
_warm: set[str] = set()

#: The meshes that were kept, the oldest first.
_meshes: dict[Hashable, Mesh | None] = {}


@dataclass(frozen=True)
class Job:
    """A scenario to be run in `folder`, its paths relative to `base`; a short run is repeated for up to `repeats_s`.

    `alone` says whether nobody else uses the worker's cores meanwhile. What is needed for a while only goes to
    `scratch`, which whoever asks removes: a worker may be killed.
    """

    scenario: Scenario
    base: Path
    folder: Path
    scratch: Path
    repeats_s: float
    alone: bool


def execute(job: Job) -> Trial:
    """Run a point to its end, or go on with it where it was cut off; what came of it is written to its folder."""
    with _busy:
        _keep(job.scratch)
        trial = _tried(job)
        trial.write()
        return trial


@cache
def _keep(scratch: Path) -> None:
    """Whatever this process unpacks is kept for its next points."""
    scratch.mkdir(parents=True, exist_ok=True)
    keep_unpacked(Path(mkdtemp(dir=scratch)))


def time_once(job: Job) -> Cost:
    """Run a point that was done once more, for what it costs; its results are kept nowhere."""
    with _busy:
        _keep(job.scratch)
        _warm_up(job)
        return _again(job)


def _again(job: Job) -> Cost:
    with TemporaryDirectory(dir=job.scratch) as folder:
        run_scenario(job.scenario, job.base, Path(folder), mesh_of=_kept_mesh)
        return _cost(Path(folder))


def _tried(job: Job) -> Trial:
    _warm_up(job)
    try:
        try:
            run_scenario(job.scenario, job.base, job.folder, resume=True, mesh_of=_kept_mesh)
        except InputError:
            # What was left there may be of another machine; if the scenario itself is wrong, that is said again.
            run_scenario(job.scenario, job.base, job.folder, mesh_of=_kept_mesh)
    except InputError as error:
        return Trial(job.folder, REFUSED, str(error))
    except RunError as error:
        return Trial(job.folder, FAILED, str(error))
    except Exception as error:
        # A bug, which ends a run with exit code 1; the study's other points are not worse for it.
        return Trial(job.folder, FAILED, f"{BUG}: {type(error).__name__}: {error}")
    summary = StoredRun(job.folder).summary
    costs = [_cost(job.folder)]
    while len(costs) < _RUNS and costs[0].wall_s < _SHORT_S and sum(cost.wall_s for cost in costs[1:]) < job.repeats_s:
        costs.append(_again(job))
    return Trial(job.folder, DONE, "", tuple(costs), summary["solves"], summary["sweeps"], job.alone)


def _cost(folder: Path) -> Cost:
    summary = StoredRun(folder).summary
    return Cost(summary["wall_s"]["total"], summary["cpu_s"]["total"], summary["cpu_s"]["units"])


def _warm_up(job: Job) -> None:
    """Run a point's first moments for nothing, where nothing like it was run in this process: no point is cold."""
    scenario = job.scenario
    units = {name: entry.unit or entry.fmu for name, entry in scenario.units.items()}
    what = json.dumps([_scene(scenario), units, scenario.run.participants, scenario.run.workers])
    if what in _warm:
        return
    _warm.add(what)
    run = scenario.run.model_copy(update={"stop_ms": min(scenario.output.every_ms, scenario.run.stop_ms)})
    with TemporaryDirectory(dir=job.scratch) as folder:
        try:
            run_scenario(scenario.model_copy(update={"run": run}), job.base, Path(folder), mesh_of=_kept_mesh)
        except Exception:
            # Whatever it is, the run that counts will say it.
            return


def _kept_mesh(scenario: Scenario, base: Path) -> Mesh | None:
    """The mesh of `scenario`, from those that were kept where it is among them."""
    check_units(scenario)
    if scenario.scene is None:
        return None
    file = None if scenario.scene.mesh is None else base / scenario.scene.mesh
    written = 0 if file is None or not file.is_file() else file.stat().st_mtime_ns
    # Which units there are decides what is asked of the mesh.
    units = frozenset(entry.unit for entry in scenario.units.values())
    key = (_scene(scenario), base, written, units)
    if key not in _meshes:
        mesh = checked_mesh(scenario, base)
        while len(_meshes) >= _MESHES:
            del _meshes[next(iter(_meshes))]
        _meshes[key] = mesh
    return _meshes[key]


def _scene(scenario: Scenario) -> str:
    return "" if scenario.scene is None else scenario.scene.model_dump_json()
