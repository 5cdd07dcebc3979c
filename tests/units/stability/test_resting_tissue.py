"""If these fail, it would not be known which error of the stretch starts a beat."""

from collections.abc import Callable
from typing import Any

import pytest
from cardiac_cosim.units.errors import InvalidInput
from cardiac_cosim.units.stability.resting_tissue import RestingTissue
from cardiac_cosim.units.stability.theory import Coupled, Setting


def _coupled(setting: Callable[..., Setting], offset: float, **parameters: Any) -> Coupled:
    units = {"strain": setting("response", offset=offset), "cell": setting("electrophysiology", **parameters)}
    return Coupled(units, False, 1.0)


def test_the_hearts_tissue_fires_beyond_a_stretch_of_3e_5(setting: Callable[..., Setting]) -> None:
    # docs/model.md, Numbers to verify against: λ − 1 > 3.3e-5.
    assert 1.0 / RestingTissue().amplification(_coupled(setting, 1.0)) == pytest.approx(3.3e-5, rel=0.02)


def test_for_a_small_threshold_it_grows_with_its_square(setting: Callable[..., Setting]) -> None:
    for threshold in (1e-3, 1e-4):
        found = 1.0 / RestingTissue().amplification(_coupled(setting, 1.0, excitation_threshold=threshold))
        assert found == pytest.approx(8.0 * threshold**2 / (4.0 * 0.6 * 10.0), rel=2.0 * threshold / 0.6)


def test_compressed_tissue_rests(setting: Callable[..., Setting]) -> None:
    assert RestingTissue().amplification(_coupled(setting, -0.1)) == 0.0


def test_another_ionic_model_is_refused(setting: Callable[..., Setting]) -> None:
    with pytest.raises(InvalidInput, match="aliev_panfilov"):
        RestingTissue().amplification(_coupled(setting, 1e-5, ionic_model="mitchell_schaeffer"))
