"""Electrophysiology refined inside a coarse heart, compared with hearts whose whole mesh is refined.

The refined meshes inherit the fibres of the coarse one. The activation time of the apex is printed for two cases.
Without mechano-electric feedback, `refine` is 0, 1 and 2, and each is compared with electrophysiology on the refined
mesh itself. With feedback, `refine: 1` is compared with a heart whose whole mesh is refined, for the mechanics too.
"""

from time import perf_counter

import numpy as np
from cardiac_cosim.units.active_stress import ActiveStress
from cardiac_cosim.units.electrophysiology import Electrophysiology
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry.registry import build
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.refinement import refined
from cardiac_cosim.units.unit import Unit

_APEX_MM = np.array([0.0, 0.0, -60.0])
_STOP_MS, _STEP_MS = 130, 2


def started(unit: Unit, parameters: dict[str, float], inputs: dict[str, np.ndarray]) -> Unit:
    unit.instantiate(parameters)
    unit.setup_experiment()
    unit.enter_initialization_mode()
    for name, values in inputs.items():
        unit.set(name, values)
    unit.exit_initialization_mode()
    return unit


def _beat(mesh: Mesh, directions: dict[str, np.ndarray], parameters: dict[str, float], mechanics: bool) -> np.ndarray:
    """Activation times in ms of all nodes: with `mechanics` coupled by Gauss–Seidel, otherwise of the wave alone."""
    wave = started(Electrophysiology(mesh), parameters, {"fiber": directions["fiber"]})
    tension = started(ActiveStress(mesh), {}, {})
    wall = started(Mechanics(mesh), {}, directions) if mechanics else None
    for number in range(_STOP_MS // _STEP_MS):
        time, step = 1e-3 * _STEP_MS * number, 1e-3 * _STEP_MS
        wave.do_step(time, step)
        if wall is not None:
            tension.set("potential", wave.get("potential"))
            tension.do_step(time, step)
            wall.set("active_stress", tension.get("active_stress"))
            wall.do_step(time, step)
            wave.set("stretch", wall.get("stretch"))
    return np.asarray(wave.get("activation_time"))


def _report(what: str, heart: Mesh, times: np.ndarray, since: float) -> None:
    # The first nodes of a refined mesh are those of the coarse one.
    apex = np.linalg.norm(heart.points - _APEX_MM, axis=1).argmin()
    print(f"{what:45s} apex activated at {times[apex]:7.2f} ms   ({perf_counter() - since:.0f} s)", flush=True)


if __name__ == "__main__":
    heart = build("biventricle", 5.0)
    generator = started(FiberGenerator(heart), {}, {})
    own = {name: generator.get(name) for name in ("fiber", "sheet")}
    quiet = {"stretch_conductance": 0.0}
    for level in range(3):
        fine = refined(heart, level)
        inherited = {name: values[fine.parents] for name, values in own.items()}
        begin = perf_counter()
        inside = _beat(heart, own, quiet | {"refine": level}, mechanics=False)
        _report(f"without feedback, refine: {level}", heart, inside, begin)
        if level:
            begin = perf_counter()
            outside = _beat(fine.mesh, inherited, quiet, mechanics=False)
            _report(f"without feedback, whole mesh refined {level} times", heart, outside, begin)
            print(f"  largest difference at a node: {np.abs(inside - outside[: heart.nodes]).max():.1e} ms")
    fine = refined(heart, 1)
    begin = perf_counter()
    _report("with feedback, refine: 0", heart, _beat(heart, own, {}, mechanics=True), begin)
    begin = perf_counter()
    _report("with feedback, refine: 1", heart, _beat(heart, own, {"refine": 1}, mechanics=True), begin)
    begin = perf_counter()
    inherited = {name: values[fine.parents] for name, values in own.items()}
    _report("with feedback, whole mesh refined once", heart, _beat(fine.mesh, inherited, {}, mechanics=True), begin)
    begin = perf_counter()
    _report("with feedback, refine: 2", heart, _beat(heart, own, {"refine": 2}, mechanics=True), begin)
