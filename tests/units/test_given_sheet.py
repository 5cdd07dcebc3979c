"""If these fail, mechanics that is run by itself has sheets along its fibres, or takes others than it was given."""

import numpy as np
from cardiac_cosim.units.directions import SHEET_INPUT, given_sheet


def test_a_sheet_that_nobody_gives_is_normal_to_any_fibre() -> None:
    fiber = np.random.default_rng(3).normal(size=(50, 3))
    fiber[:4] = [*np.eye(3), [1.0, 1.0, 1.0]]
    fiber /= np.linalg.norm(fiber, axis=1, keepdims=True)
    sheet = given_sheet(np.full((50, 3), SHEET_INPUT.start), fiber)
    np.testing.assert_allclose(np.linalg.norm(sheet, axis=1), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.einsum("ei,ei->e", sheet, fiber), 0.0, atol=1e-15)


def test_a_sheet_that_was_given_is_taken_as_it_is() -> None:
    # In one element it may happen to be what it starts with.
    sheet = np.tile([0.0, 1.0, 0.0], (5, 1))
    sheet[0] = SHEET_INPUT.start
    assert given_sheet(sheet, np.tile([1.0, 0.0, 0.0], (5, 1))) is sheet
