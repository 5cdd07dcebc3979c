"""If these fail, the picture of a scenario shows another coupling than the run has, or cannot be read."""

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from cardiac_cosim.orchestrator.scenario import load_scenario
from cardiac_cosim.orchestrator.showing import Graph, assembled, graph_of
from cardiac_cosim.orchestrator.showing.graph import Reading
from cardiac_cosim.orchestrator.showing.graph_picture import draw_graph
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

_SCENARIOS = Path(__file__).parents[2] / "scenarios"
_ITERATE = "coupling.iterate={converge: {stretch: {relative: 1e-4}}}"


def _graph(path: Path, *sets: str) -> Graph:
    with assembled(load_scenario(path, sets), path.parent) as assembly:
        return graph_of(assembly)


def _read(graph: Graph) -> dict[str, Reading]:
    return {f"{edge.source} -> {edge.target}.{edge.input}": edge.reading for edge in graph.edges}


def _places(graph: Graph) -> dict[str, int | None]:
    return {node.name: node.place for node in graph.nodes}


def test_gauss_seidel_reads_back_what_comes_later_and_jacobi_everything(small_scenario: Path) -> None:
    graph = _graph(small_scenario)
    assert _places(graph) == {"fibers": None, "electrophysiology": 1, "active_stress": 2, "mechanics": 3}
    read = _read(graph)
    assert read["electrophysiology -> active_stress.potential"] is Reading.SAME_SWEEP
    assert read["active_stress -> mechanics.active_stress"] is Reading.SAME_SWEEP
    assert read["mechanics -> electrophysiology.stretch"] is Reading.BEFORE
    assert read["fibers -> mechanics.fiber"] is Reading.ONCE
    turned = _graph(small_scenario, "coupling.order=[mechanics, active_stress, electrophysiology]")
    assert _read(turned)["mechanics -> electrophysiology.stretch"] is Reading.SAME_SWEEP
    assert _read(turned)["electrophysiology -> active_stress.potential"] is Reading.BEFORE
    jacobi = _graph(small_scenario, "coupling.scheme=jacobi")
    assert set(_places(jacobi).values()) == {None, 1}
    assert Reading.SAME_SWEEP not in _read(jacobi).values()
    assert jacobi.before == "value of the last communication point"
    assert _graph(small_scenario, _ITERATE).before == "value of the sweep before, until the loop has converged"


def test_loops_are_those_that_show_tells(small_scenario: Path) -> None:
    graph = _graph(small_scenario)
    assert {node.name for node in graph.nodes if node.in_loop} == {"electrophysiology", "active_stress", "mechanics"}
    assert [edge.source for edge in graph.edges if edge.in_loop and edge.reading is Reading.BEFORE] == ["mechanics"]
    quiet = "units.electrophysiology.parameters={stimulus_depth_mm: 5, stretch_conductance: 0}"
    graph = _graph(small_scenario, quiet)
    assert not any(part.in_loop for part in (*graph.nodes, *graph.edges))
    # Nobody reads what mechanics computes between outputs.
    assert {node.name: node.captions for node in graph.nodes}["mechanics"] == ("at output times only",)


def test_an_iterated_loop_comes_after_what_feeds_it(tmp_path: Path) -> None:
    units = "{a: {unit: response}, b: {unit: response}, c: {unit: response}}"
    path = tmp_path / "three.yaml"
    path.write_text(
        f"name: three\nscene: {{geometry: cell}}\nunits: {units}\nconnect_by_name: false\n"
        "connections: [a.y -> b.u, b.y -> a.u, c.y -> a.v]\n"
        "coupling: {iterate: {converge: {a.y: {relative: 1e-4}}}}\nrun: {stop_ms: 10}\n"
    )
    text = path.read_text()
    ports = _graph(_SCENARIOS / "feedback.yaml").edges
    name = ports[0].input
    path.write_text(text.replace("b.u", f"b.{name}").replace("a.u, c.y -> a.v", f"a.{name}, a.y -> c.{name}"))
    assert _places(_graph(path)) == {"a": 1, "b": 2, "c": 3}
    assert _places(_graph(path, "coupling.scheme=jacobi")) == {"a": 1, "b": 1, "c": 2}
    assert _read(_graph(path, "coupling.scheme=jacobi"))[f"a -> c.{name}"] is Reading.SAME_SWEEP


def test_fields_have_their_unit_of_measure_and_shape_and_files_their_names(small_scenario: Path) -> None:
    outputs = {edge.output for edge in _graph(small_scenario).edges}
    assert outputs >= {"potential (mV, 271 nodes)", "active_stress (kPa, 271 nodes)"}
    assert any(text.startswith("fiber (") and text.endswith(" elements × 3)") for text in outputs)
    driven = _graph(_SCENARIOS / "inflation.yaml")
    assert driven.nodes[0].name == "inflation.csv"
    assert _read(driven)["inflation.csv -> mechanics.lv_pressure (kPa)"] is Reading.FILE
    assert driven.title.startswith("inflation: left_ventricle, 8 mm, ")


_PICTURES = [
    ("baseline.yaml", ()),
    ("cell.yaml", ()),
    ("cell.yaml", ("coupling.scheme=jacobi",)),
    ("cell.yaml", (_ITERATE,)),
    ("oscillator.yaml", ()),
    ("inflation.yaml", ()),
    ("feedback.yaml", ()),
    ("arrival_times.yaml", ()),
]


def _extents(figure: Figure) -> list[tuple[str, Bbox]]:
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    texts = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    return [(text.get_text(), text.get_window_extent(renderer)) for text in texts]


@pytest.mark.parametrize(("name", "sets"), _PICTURES, ids=[f"{name} {' '.join(sets)}" for name, sets in _PICTURES])
def test_no_word_lies_on_another_or_beyond_the_edge(name: str, sets: tuple[str, ...]) -> None:
    graph = _graph(_SCENARIOS / name, *sets)
    figure = draw_graph(graph)
    extents = _extents(figure)
    texts = [text for text, _ in extents]
    for edge in graph.edges:
        assert {edge.output, edge.input} <= set(texts)
    width, height = figure.bbox.width, figure.bbox.height
    for text, box in extents:
        assert min(box.x0, box.y0, width - box.x1, height - box.y1) > 0.0, text
    for (one, first), (other, second) in combinations(extents, 2):
        assert not first.overlaps(second), (one, other)
    # Words of a unit lie inside of its rectangle.
    boxes = [patch.get_window_extent() for patch in figure.axes[0].patches if patch.get_height() > 0]  # type: ignore[attr-defined]
    for edge in graph.edges:
        found = [box for text, box in extents if text == edge.output]
        assert all(any(box.x0 < each.x0 and each.x1 < box.x1 for box in boxes) for each in found)


def test_it_is_written_in_the_format_of_its_ending_and_to_the_same_bytes(
    cosim: Callable[..., Any], tmp_path: Path
) -> None:
    scenario = _SCENARIOS / "cell.yaml"
    for ending, begin in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF")):
        path = tmp_path / "new" / f"graph.{ending}"
        ended = cosim("show", scenario, "--graph", path)
        assert (ended.code, ended.out) == (0, f"graph in {path}\n")
        content = path.read_bytes()
        assert content.startswith(begin)
        assert cosim("show", scenario, "--graph", path).code == 0
        assert path.read_bytes() == content
    # As text, which can be searched and read aloud.
    assert "electrophysiology" in (tmp_path / "new" / "graph.svg").read_text()
    for wrong in ("graph.gif", "graph", "graph.svg.txt"):
        ended = cosim("show", scenario, "--graph", tmp_path / wrong)
        assert ended.code == 2
        assert "one of .svg, .png, .pdf" in ended.err
        assert not (tmp_path / wrong).exists()
    (tmp_path / "file").write_text("")
    ended = cosim("show", scenario, "--graph", tmp_path / "file" / "graph.svg")
    assert ended.code in (2, 3)
    assert ended.err.count("\n") == 1


def test_parameters_are_listed_and_those_that_the_scenario_changes_are_marked(
    cosim: Callable[..., Any], small_scenario: Path
) -> None:
    ended = cosim("show", small_scenario, "--parameters", "--set", "units.mechanics.parameters.shear_modulus_MPa=0.25")
    assert ended.code == 0
    parts = {part.partition(":")[0]: part.splitlines()[1:] for part in ended.out.split("\n\n")}
    assert list(parts)[1:] == ["fibers", "electrophysiology", "active_stress", "mechanics"]
    changed = {
        name: [line.split()[1:4] for line in lines if line.lstrip().startswith("*")] for name, lines in parts.items()
    }
    assert changed["electrophysiology"] == [["stimulus_depth_mm", "5", "2"]]
    assert [row[:2] for row in changed["mechanics"]] == [["shear_modulus_MPa", "0.25"]]
    assert changed["active_stress"] == []
    line = next(line for line in parts["mechanics"] if "shear_modulus_MPa" in line)
    assert " MPa  " in line
    assert "> 0" in line
    # A value that is given as the default is one.
    given = cosim("show", small_scenario, "--parameters", "--set", "units.electrophysiology.parameters={}")
    assert "  *" not in given.out
