"""If these fail, a value set under one name lands in another place of the field."""

import re

import numpy as np
import pytest
from cardiac_cosim.fmus.layout import layout
from cardiac_cosim.units.mesh import Mesh
from cardiac_cosim.units.registry import UNITS
from fmpy import read_model_description


@pytest.mark.parametrize("unit", UNITS)
def test_value_references_are_consecutive_and_in_the_order_of_the_names(unit: str, tiny: Mesh) -> None:
    runs = layout(UNITS[unit], tiny)
    assert [run.variable for run in runs] == list(UNITS[unit].variables())
    assert [run.first for run in runs] == [0, *np.cumsum([run.size for run in runs])[:-1].tolist()]
    for run in runs:
        names = list(run.names())
        assert len(names) == run.size == len(set(names))
        if run.shape:
            indices = [tuple(map(int, re.findall(r"\d+", name.removeprefix(run.variable.name)))) for name in names]
            # Base 1, row-major: the place in the flat array is NumPy's for the same indices.
            places = [np.ravel_multi_index(tuple(i - 1 for i in index), run.shape) for index in indices]
            assert places == list(range(run.size))
        else:
            assert names == [run.variable.name]


def test_a_field_of_vectors_and_a_scalar(tiny: Mesh) -> None:
    runs = {run.variable.name: run for run in layout(UNITS["mechanics"], tiny)}
    assert list(runs["displacement"].names())[:4] == [f"displacement[{i}]" for i in ("1,1", "1,2", "1,3", "2,1")]
    assert runs["displacement"].size == 3 * tiny.nodes
    assert runs["stretch"].size == tiny.elements
    assert list(runs["lv_volume"].names()) == ["lv_volume"]


@pytest.mark.parametrize("unit", UNITS)
def test_the_description_lists_the_scalars_as_laid_out(unit: str, tiny: Mesh, fmus: dict) -> None:
    variables = read_model_description(str(fmus[unit]), validate=False).modelVariables
    laid_out = [(name, run.type_in(2)) for run in layout(UNITS[unit], tiny) for name in run.names()]
    assert [(variable.name, variable.type) for variable in variables] == laid_out
    assert [variable.valueReference for variable in variables] == list(range(len(laid_out)))
