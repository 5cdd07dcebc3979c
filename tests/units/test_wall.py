"""If these fail, a heart whose surfaces are named wrongly beats all the same, with volumes and fibres of no heart."""

from collections.abc import Callable

import numpy as np
import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.fiber_generator import FiberGenerator
from cardiac_cosim.units.geometry import registry
from cardiac_cosim.units.mechanics import Mechanics
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.mesh.wall import wall_of, wall_warnings

Boundaries = dict[str, np.ndarray]


def _with(mesh: Mesh, change: Callable[[Boundaries], Boundaries]) -> Mesh:
    return Mesh(mesh.points, mesh.cells, change(dict(mesh.boundaries)))


def _renamed(mesh: Mesh, **names: str) -> Mesh:
    return _with(mesh, lambda have: {names.get(name, name): faces for name, faces in have.items()})


def _left(mesh: Mesh) -> Mesh:
    """The left ventricle's names on both: what bounds the right one is its outside."""

    def merge(have: Boundaries) -> Boundaries:
        outside = [have.pop(name) for name in ("epicardium", "rv_endocardium", "rv_septum")]
        return have | {"epicardium": np.vstack(outside)}

    return _with(mesh, merge)


def test_the_anatomy_follows_from_the_names(small_heart: Mesh) -> None:
    assert set(wall_of(small_heart).cavities) == {"lv_volume", "rv_volume"}
    assert set(wall_of(_left(small_heart)).cavities) == {"lv_volume"}
    assert wall_of(registry.build("slab", 6.0)).cavities == {}


def test_a_group_beside_the_boundaries_changes_nothing(small_heart: Mesh, started) -> None:
    both = np.vstack([small_heart.boundary("lv_endocardium"), small_heart.boundary("rv_endocardium")])
    more = _with(small_heart, lambda have: have | {"surface": small_heart.surface, "endocardium": both})
    assert wall_warnings(more) == ["the boundary 'endocardium' repeats faces of others and is not used"]
    assert wall_of(more) == wall_of(small_heart)
    fibers = [started(FiberGenerator, mesh).get("fiber") for mesh in (small_heart, more)]
    np.testing.assert_array_equal(*fibers)


def test_an_endocardium_with_faces_of_its_own_is_refused(small_heart: Mesh) -> None:
    own = np.vstack([small_heart.boundary("lv_endocardium"), small_heart.boundary("epicardium")[:3]])
    with pytest.raises(InvalidInput, match=r"3 of 113 faces of the boundary 'endocardium' .*name them 'lv_endocard"):
        wall_of(_with(small_heart, lambda have: have | {"endocardium": own}))


def test_an_endocardium_that_hides_a_cavity_is_refused(small_heart: Mesh) -> None:
    message = r"'endocardium' \(110 faces\) encloses a cavity.*'base' \(57 faces\).*name it 'lv_endocardium'"
    hidden = _renamed(_left(small_heart), lv_endocardium="endocardium")
    for unit in (FiberGenerator, Mechanics):
        with pytest.raises(InvalidInput, match=message):
            unit.check_mesh(hidden)
    together = ("lv_endocardium", "rv_endocardium", "rv_septum")
    union = np.vstack([small_heart.boundary(name) for name in together])
    both = _with(
        small_heart,
        lambda have: {name: have[name] for name in ("base", "epicardium")} | {"endocardium": union},
    )
    with pytest.raises(InvalidInput, match=r"'endocardium' \(200 faces\) encloses a cavity"):
        wall_of(both)


@pytest.mark.parametrize("of", ["both", "left"])
def test_a_surface_that_belongs_to_no_boundary_is_refused(of: str, small_heart: Mesh) -> None:
    mesh = small_heart if of == "both" else _left(small_heart)

    def split(have: Boundaries) -> Boundaries:
        right = mesh.points[have["epicardium"]].mean(axis=1)[:, 0] > 0.0
        return have | {"epicardium": have["epicardium"][~right], "RV_EPI": have["epicardium"][right]}

    torn = _with(mesh, split)
    count = len(torn.boundary("RV_EPI"))
    message = rf"{count} of 484 faces of the surface are in none of .*\({count} in 'RV_EPI'\).*\[epicardium, RV_EPI\]"
    for unit in (FiberGenerator, Mechanics):
        with pytest.raises(InvalidInput, match=message):
            unit.check_mesh(torn)


@pytest.mark.parametrize(("one", "other"), [("epicardium", "base"), ("rv_septum", "epicardium")])
def test_a_face_in_two_boundaries_is_refused(one: str, other: str, small_heart: Mesh) -> None:
    def double(have: Boundaries) -> Boundaries:
        return have | {one: np.vstack([have[one], have[other][:5, [1, 0, 2]]])}

    message = r"5 faces are in two boundaries, '\w+' \(\d+ faces\) and '\w+' \(\d+ faces\)"
    with pytest.raises(InvalidInput, match=message) as refusal:
        wall_of(_with(small_heart, double))
    assert f"'{one}' ({len(small_heart.boundary(one)) + 5} faces)" in str(refusal.value)
    assert f"'{other}' ({len(small_heart.boundary(other))} faces)" in str(refusal.value)


def test_exchanged_names_are_refused(small_heart: Mesh) -> None:
    outside_in = _renamed(_left(small_heart), epicardium="lv_endocardium", lv_endocardium="epicardium")
    for unit in (FiberGenerator, Mechanics):
        with pytest.raises(InvalidInput, match=r"lv_endocardium \(317 faces\) encloses -\d+ ml: .*exchanged"):
            unit.check_mesh(outside_in)
    chambers = _renamed(small_heart, lv_endocardium="rv_endocardium", rv_endocardium="lv_endocardium")
    with pytest.raises(InvalidInput, match="rim off the base"):
        wall_of(chambers)


def test_a_septum_that_lies_outside_is_told(small_heart: Mesh) -> None:
    assert wall_warnings(small_heart) == []
    (warning,) = wall_warnings(_renamed(small_heart, rv_septum="rv_endocardium", rv_endocardium="rv_septum"))
    assert warning.startswith("'rv_septum' lies farther from the left cavity than 'rv_endocardium'")


def test_a_hole_in_a_cavitys_wall_is_refused_without_mechanics_too(small_heart: Mesh) -> None:
    def pierce(have: Boundaries) -> Boundaries:
        low = small_heart.points[have["lv_endocardium"], 2].mean(axis=1).argmin()
        moved = have["lv_endocardium"][low : low + 1]
        rest = np.delete(have["lv_endocardium"], low, axis=0)
        return have | {"lv_endocardium": rest, "epicardium": np.vstack([have["epicardium"], moved])}

    with pytest.raises(InvalidInput, match="lv_endocardium has a rim off the base"):
        FiberGenerator.check_mesh(_with(small_heart, pierce))
