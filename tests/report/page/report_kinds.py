"""Scenes of all kinds, small and short."""

from collections.abc import Callable

from cardiac_cosim.orchestrator.results.stored_run import StoredRun

#: From a kind of scene to its run.
RunOf = Callable[[str], StoredRun]

#: Each by its scenario and what is set in it.
SHORT: dict[str, tuple[str, dict[str, object]]] = {
    "strand": ("strand", {"run.stop_ms": 20, "scene.mesh_size_mm": 2}),
    "sheet": ("sheet", {"run.stop_ms": 20, "scene.mesh_size_mm": 5}),
    "cell": ("cell", {"run.stop_ms": 20}),
    "oscillator": ("oscillator", {}),
    "iterated": (
        "slab",
        {
            "run.stop_ms": 20,
            "coupling.step_ms": 5,
            "scene.mesh_size_mm": 8,
            "coupling.iterate": {"acceleration": "aitken", "converge": {"stretch": {"relative": 1e-6}}},
        },
    ),
    "adaptive": ("slab", {"run.stop_ms": 20, "scene.mesh_size_mm": 8, "coupling.adaptive": {"tolerance": 0.1}}),
    "failed": ("slab", {"scene.mesh_size_mm": 8, "units.mechanics.parameters.neo_hooke_log_sign": "as_printed"}),
}

#: Those that no test of their own looks at.
OTHERS = ["strand", "sheet", "cell", "oscillator", "adaptive"]

HEART = """\
name: small_heart
scene: {mesh: MESH}
units:
  fibers: {unit: fiber_generator}
  electrophysiology: {unit: electrophysiology, parameters: {stimulus_depth_mm: 5}}
  active_stress: {unit: active_stress}
  mechanics: {unit: mechanics}
coupling: {step_ms: 5}
run: {stop_ms: 40, participants: native}
output:
  every_ms: 5
  probes_mm: {base: [25, 0, -1], apex: [0, 0, -60]}
"""
