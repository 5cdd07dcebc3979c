"""If these failed, somebody with another FMI tool would get another heartbeat from our FMUs than we do, or none."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np


def test_fmpy_runs_one_unit_as_we_do(workshop: Any, ours: Callable[..., Any]) -> None:
    workshop.follow("fmpy")
    own = ours(
        "cell",
        "units={fibers: {unit: fiber_generator}, "
        "electrophysiology: {unit: electrophysiology, parameters: {time_scale_reduction: 0}}}",
        "output.every_ms=500",
    )["potential_cell_mV"]
    theirs = workshop.load("fmpy.npy")
    assert theirs.shape == own.shape == (501,)
    # A step is the difference of two times there, and differs from ours in the last bit.
    np.testing.assert_allclose(theirs, own, rtol=0, atol=1e-12)


def test_libcosim_couples_the_strand_as_we_do(workshop: Any, strand: Any) -> None:
    workshop.follow("libcosimpy")
    theirs = workshop.load("libcosimpy.npy")
    own = strand["potential_mV"][1:]
    assert theirs.shape == own.shape
    # It counts nanoseconds: steps and times differ from ours in the last bit.
    np.testing.assert_allclose(theirs, own, rtol=0, atol=1e-12)


def test_ecos_couples_the_strand_as_we_do(workshop: Any, strand: Any) -> None:
    workshop.follow("ecospy")
    assert np.array_equal(workshop.load("ecospy.npy"), strand["potential_mV"][1:])


def test_ecos_does_not_tell_of_failures(workshop: Any) -> None:
    # The page warns of it. A substep that is too long ends the initialization: an error, and NaN from then on.
    text = """
from ecospy import EcosSimulation, EcosSimulationStructure
structure = EcosSimulationStructure()
structure.add_model("unit", "cell/electrophysiology.fmu")
structure.add_parameter_set("long", {"unit::longest_substep_ms": 5.0})
with EcosSimulation(step_size=1e-3, structure=structure) as simulation:
    print(simulation.init(parameter_set="long"), simulation.step(), simulation.get_real("unit::potential[1]"))
"""
    assert workshop.run([sys.executable, "-c", text]) == "True 0.001 nan\n"


def test_a_container_of_all_units_beats_as_they_do(workshop: Any, strand: Any) -> None:
    workshop.follow("fmu-manipulation-toolbox")
    theirs = workshop.load("container.npy")
    assert np.array_equal(theirs["electrophysiology.potential_mean"], strand["potential_mV"].mean(axis=1))
    assert np.array_equal(theirs["electrophysiology.potential_max"], strand["potential_mV"].max(axis=1))
    assert np.array_equal(theirs["active_stress.active_stress_mean"], strand["active_stress_mean_kPa"])
    assert np.array_equal(theirs["mechanics.stretch_mean"], strand["stretch"].mean(axis=1))


def test_the_page_on_the_c_host_shows_our_numbers(workshop: Any, ours: Callable[..., Any]) -> None:
    lines = workshop.follow("c-host")
    theirs = np.array([[float(word) for word in line.split()] for line in lines])
    own = ours("cell", "run.stop_ms=3")
    assert np.array_equal(theirs, np.column_stack([own["potential_mV"][:, 0], own["active_stress_mean_kPa"]]))


def test_every_tool_has_a_page_that_the_index_leads_to() -> None:
    pages = Path(__file__).parents[3] / "docs" / "tools"
    index = (pages / "README.md").read_text(encoding="utf-8")
    linked = {part.split(")")[0] for part in index.split("](")[1:]}
    assert {path.name for path in pages.glob("*.md")} - {"README.md"} <= linked
