"""If these fail, the tissue resists deformation with the wrong force, or Newton's method goes the wrong way."""

import numpy as np
import pytest
from cardiac_cosim.units.mechanics.kinematics import Kinematics, cofactors, determinant, voigt
from cardiac_cosim.units.mechanics.laws.guccione import Guccione
from cardiac_cosim.units.mechanics.laws.holzapfel_fiber import HolzapfelFiber
from cardiac_cosim.units.mechanics.laws.neo_hooke import NeoHooke
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

_FIBER = np.array([0.6, -0.48, 0.64])
_FIBER /= np.linalg.norm(_FIBER)
# So small because of the fibre, which stiffens so fast that its higher derivatives count.
_STEPS = (4e-3, 2e-3, 1e-3)

_LAWS = {
    "neo_hooke": NeoHooke(),
    "neo_hooke as printed": NeoHooke(neo_hooke_log_sign="as_printed"),
    "fiber": HolzapfelFiber(),
    "guccione": Guccione(),
    "guccione, isotropic": Guccione(0.01, guccione_fiber=1.0, guccione_transverse=1.0, guccione_shear=1.0),
}


def _at(gradient: np.ndarray, fiber: np.ndarray = _FIBER) -> Kinematics:
    gradient = np.asarray(gradient, dtype=float).reshape(-1, 3, 3)
    cauchy_green = gradient.transpose(0, 2, 1) @ gradient
    sheet = np.cross(fiber, [0.0, 0.0, 1.0])
    sheet /= np.linalg.norm(sheet)
    structures = (np.tile(np.outer(axis, axis), (len(gradient), 1, 1)) for axis in (fiber, sheet))
    return Kinematics(cauchy_green, np.linalg.inv(cauchy_green), np.log(np.linalg.det(gradient)), *structures)


def _isochoric_fiber_square(gradient: np.ndarray) -> float:
    return float(np.linalg.det(gradient) ** (-2.0 / 3.0) * np.sum((gradient @ _FIBER) ** 2))


def _gradients(taut: bool) -> list[np.ndarray]:
    """Random deformations with the fibre in tension, or slack."""
    random, found = np.random.default_rng(7), []
    while len(found) < 4:
        gradient = np.eye(3) + random.uniform(-0.25, 0.25, (3, 3))
        square = _isochoric_fiber_square(gradient)
        if np.linalg.det(gradient) > 0.3 and (1.05 < square < 1.5 if taut else 0.5 < square < 0.95):
            found.append(gradient)
    return found


_CASES = [
    pytest.param(law, gradient, id=f"{name}-{'taut' if taut else 'slack'}-{number}")
    for name, law in _LAWS.items()
    for taut in (True, False)
    for number, gradient in enumerate(_gradients(taut))
    if taut or name != "fiber"
]


@pytest.mark.parametrize(("law", "gradient"), _CASES)
def test_stress_is_the_derivative_of_the_energy(law, gradient: np.ndarray, slopes) -> None:
    direction = np.random.default_rng(8).standard_normal((3, 3))
    nominal = gradient @ law.stress(_at(gradient))[0]
    exact = np.sum(nominal * direction)

    def difference(step: float) -> float:
        up, down = (law.energy(_at(gradient + sign * step * direction))[0] for sign in (1.0, -1.0))
        return (up - down) / (2.0 * step)

    errors = [abs(difference(step) - exact) for step in _STEPS]
    assert errors[-1] < 1e-2 * np.linalg.norm(nominal)
    orders = slopes(_STEPS, errors)
    assert ((orders > 1.9) & (orders < 2.1)).all(), orders


@pytest.mark.parametrize(("law", "gradient"), _CASES)
def test_tangent_is_the_derivative_of_the_stress(law, gradient: np.ndarray, slopes) -> None:
    direction = np.random.default_rng(9).standard_normal((3, 3))
    strain = 0.5 * (direction.T @ gradient + gradient.T @ direction)
    engineering = voigt(strain[None])[0] * [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    exact = law.tangent(_at(gradient))[0] @ engineering

    def difference(step: float) -> np.ndarray:
        up, down = (voigt(law.stress(_at(gradient + sign * step * direction)))[0] for sign in (1.0, -1.0))
        return (up - down) / (2.0 * step)

    errors = [np.abs(difference(step) - exact).max() for step in _STEPS]
    assert errors[-1] < 1e-2 * np.abs(exact).max()
    orders = slopes(_STEPS, errors)
    assert ((orders > 1.9) & (orders < 2.1)).all(), orders


@pytest.mark.parametrize(("law", "gradient"), _CASES)
def test_stress_and_tangent_have_their_symmetries(law, gradient: np.ndarray) -> None:
    stress, tangent = law.stress(_at(gradient))[0], law.tangent(_at(gradient))[0]
    np.testing.assert_allclose(stress, stress.T, rtol=0.0, atol=1e-14 * np.abs(stress).max())
    np.testing.assert_allclose(tangent, tangent.T, rtol=0.0, atol=1e-13 * np.abs(tangent).max())


@pytest.mark.parametrize(("law", "gradient"), _CASES)
def test_rotating_the_deformed_tissue_changes_nothing(law, gradient: np.ndarray) -> None:
    turned = Rotation.random(rng=10).as_matrix() @ gradient
    assert np.abs(turned - gradient).max() > 0.5
    np.testing.assert_allclose(law.energy(_at(turned)), law.energy(_at(gradient)), rtol=1e-12)
    np.testing.assert_allclose(law.stress(_at(turned)), law.stress(_at(gradient)), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(law.tangent(_at(turned)), law.tangent(_at(gradient)), rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("law", [HolzapfelFiber(), Guccione()])
@pytest.mark.parametrize("gradient", _gradients(True))
def test_turning_tissue_and_load_together_turns_the_stress(law, gradient: np.ndarray) -> None:
    turn = Rotation.random(rng=11).as_matrix()
    stress = law.stress(_at(gradient))[0]
    turned = law.stress(_at(gradient @ turn.T, turn @ _FIBER))[0]
    np.testing.assert_allclose(turned, turn @ stress @ turn.T, rtol=1e-9, atol=1e-14)


def test_energies_are_zero_and_stress_free_at_rest() -> None:
    rest = _at(np.eye(3), np.array([1.0, 0.0, 0.0]))
    for law in (NeoHooke(), HolzapfelFiber(), Guccione()):
        assert law.energy(rest)[0] == 0.0
        assert not law.stress(rest).any()


def test_seeds_sign_carries_a_stress_of_two_shear_moduli_at_rest() -> None:
    stress = NeoHooke(neo_hooke_log_sign="as_printed").stress(_at(np.eye(3)))[0]
    np.testing.assert_allclose(stress, 2.0 * 0.2 * np.eye(3), rtol=1e-15)


def test_neo_hooke_at_rest_is_hookes_law() -> None:
    # λ_L 1⊗1 + 2μ I: Voigt 11,11 = λ + 2μ, 11,22 = λ, shears μ.
    expected = np.zeros((6, 6))
    expected[:3, :3] = 0.5
    expected += np.diag([0.4, 0.4, 0.4, 0.2, 0.2, 0.2])
    np.testing.assert_allclose(NeoHooke().tangent(_at(np.eye(3)))[0], expected, rtol=1e-14)


def test_stresses_by_hand() -> None:
    # F = diag(1.2, 1, 1), fibre along x: C⁻¹ = diag(1/1.44, 1, 1), ln J = ln 1.2, Ī_a = 1.2^(4/3).
    at = _at(np.diag([1.2, 1.0, 1.0]), np.array([1.0, 0.0, 0.0]))
    inverse, log = np.diag([1.0 / 1.44, 1.0, 1.0]), np.log(1.2)
    np.testing.assert_allclose(
        NeoHooke().stress(at)[0], 0.2 * (np.eye(3) - inverse) + 0.5 * log * inverse, rtol=1e-13, atol=1e-16
    )
    extension = 1.2 ** (4.0 / 3.0) - 1.0
    push = 2.0 * 0.001685 * extension * np.exp(15.779 * extension**2) * 1.2 ** (-2.0 / 3.0)
    np.testing.assert_allclose(
        HolzapfelFiber().stress(at)[0], push * (np.diag([1.0, 0.0, 0.0]) - 1.44 / 3.0 * inverse), rtol=1e-13
    )
    assert HolzapfelFiber().energy(at)[0] == pytest.approx(0.001685 / 31.558 * np.expm1(15.779 * extension**2))


def test_the_exponent_of_guccione_is_the_published_sum_over_the_strains() -> None:
    # As Land et al. 2015 print it, in the axes of fibre, sheet and normal, here along x, y and z.
    random = np.random.default_rng(12)
    for _ in range(5):
        gradient = np.eye(3) + random.uniform(-0.2, 0.2, (3, 3))
        at, ratio = _at(gradient, np.array([1.0, 0.0, 0.0])), np.linalg.det(gradient)
        (ff, fs, fn), (sf, ss, sn), (nf, ns, nn) = 0.5 * (gradient.T @ gradient - np.eye(3))
        exponent = 8.0 * ff**2 + 2.0 * (ss**2 + nn**2 + sn**2 + ns**2) + 4.0 * (fs**2 + sf**2 + fn**2 + nf**2)
        energy = 0.001 * (np.exp(exponent) - 1.0) + 0.125 * (ratio**2 - 1.0 - 2.0 * np.log(ratio))
        assert Guccione().energy(at)[0] == pytest.approx(energy, rel=1e-12)


def test_guccione_by_hand_in_stretch_and_in_shear() -> None:
    # F = diag(1.2, 1, 1), fibre along x or y: E_11 = 0.22, Q = b E_11², S_11 = C b E_11 exp Q + κ/2 (J² − 1)/J².
    for fiber, share in ((np.array([1.0, 0.0, 0.0]), 8.0), (np.array([0.0, 1.0, 0.0]), 2.0)):
        stress = Guccione().stress(_at(np.diag([1.2, 1.0, 1.0]), fiber))[0]
        assert stress[0, 0] == pytest.approx(0.002 * share * 0.22 * np.exp(share * 0.22**2) + 0.25 * 0.44 / 1.44)
        assert stress[1, 1] == pytest.approx(0.25 * 0.44)
        assert stress[2, 2] == pytest.approx(0.25 * 0.44)
    # Small shears, J = 1 to first order: S_12 = C b_fs E_12 where the fibre is along x, C b_t E_12 where along z.
    slide = np.eye(3)
    slide[0, 1] = 2e-6
    for fiber, share in ((np.array([1.0, 0.0, 0.0]), 4.0), (np.array([0.0, 0.6, 0.8]), 4.0 * 0.36 + 2.0 * 0.64)):
        assert Guccione().stress(_at(slide, fiber))[0][0, 1] == pytest.approx(0.002 * share * 1e-6, rel=1e-5)


def test_stretch_of_an_incompressible_strip_along_its_fibre_is_the_closed_form() -> None:
    # No stress across and J = 1: σ_11 = λ² S_e11 − S_e22/λ with E = (λ² − 1)/2 and (1/λ − 1)/2. By the penalty the
    # volume gives way by what the pressure, λ⁻¹ S_e22, does to it, and the stress comes near at first order in 1/κ.
    stretch = 1.3
    along, across = 0.5 * (stretch**2 - 1.0), 0.5 * (1.0 / stretch - 1.0)
    growth = 0.002 * np.exp(8.0 * along**2 + 4.0 * across**2)
    exact = growth * (stretch**2 * 8.0 * along - 2.0 * across / stretch)
    errors = []
    for bulk in (1.0, 4.0, 16.0):
        law = Guccione(guccione_bulk_modulus_MPa=bulk)

        def stress(width: float, law: Guccione = law) -> np.ndarray:
            return law.stress(_at(np.diag([stretch, width, width]), np.array([1.0, 0.0, 0.0])))[0]

        width = brentq(lambda given: stress(given)[1, 1], 0.8, 0.95, xtol=1e-14)
        errors.append(abs(stretch * stress(width)[0, 0] / width**2 - exact))
    assert errors[0] < 0.01 * exact
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.1)


@pytest.mark.parametrize("gradient", _gradients(False))
def test_slack_fibre_carries_nothing(gradient: np.ndarray) -> None:
    fiber, at = HolzapfelFiber(), _at(gradient)
    assert fiber.energy(at)[0] == 0.0
    assert not fiber.stress(at).any()
    assert not fiber.tangent(at).any()


def test_fibre_stress_is_continuous_where_it_goes_slack_and_its_tangent_jumps() -> None:
    # Isochoric: F = diag(λ, 1/√λ, 1/√λ), Ī_a = λ².
    fiber, along = HolzapfelFiber(), np.array([1.0, 0.0, 0.0])

    def at(stretch: float) -> Kinematics:
        return _at(np.diag([stretch, stretch**-0.5, stretch**-0.5]), along)

    tensions = [fiber.stress(at(1.0 + step))[0, 0, 0] for step in (1e-3, 1e-4, 1e-5)]
    # S_11 → 2k₁ (Ī_a − 1) ⅔ = (8/3) k₁ (λ − 1): goes to zero linearly.
    np.testing.assert_allclose(tensions, 8.0 / 3.0 * 0.001685 * np.array([1e-3, 1e-4, 1e-5]), rtol=5e-3)
    assert not fiber.stress(at(1.0 - 1e-5)).any()
    # 4 W'' (∂Ī_a/∂C)² = 4k₁ (2/3)² along the fibre just above, nothing just below.
    assert fiber.tangent(at(1.0 + 1e-7))[0, 0, 0] == pytest.approx(4.0 * 0.001685 * 4.0 / 9.0, rel=1e-5)
    assert not fiber.tangent(at(1.0 - 1e-7)).any()


@pytest.mark.parametrize("law", [NeoHooke(), HolzapfelFiber(), Guccione()])
def test_elements_do_not_see_each_other(law) -> None:
    gradients = np.array(_gradients(True) + _gradients(False))
    together = law.stress(_at(gradients)), law.tangent(_at(gradients)), law.energy(_at(gradients))
    for number, gradient in enumerate(gradients):
        alone = law.stress(_at(gradient)), law.tangent(_at(gradient)), law.energy(_at(gradient))
        for whole, part in zip(together, alone, strict=True):
            np.testing.assert_allclose(whole[number], part[0], rtol=1e-13, atol=1e-16)


def test_kinematics_are_lapacks() -> None:
    gradients = np.array(_gradients(True) + _gradients(False))
    ratio = determinant(gradients)
    np.testing.assert_allclose(ratio, np.linalg.det(gradients), rtol=1e-13)
    expected = ratio[:, None, None] * np.linalg.inv(gradients).transpose(0, 2, 1)
    np.testing.assert_allclose(cofactors(gradients), expected, rtol=1e-12, atol=1e-14)
    exact = _at(gradients)
    made = Kinematics.of(gradients, ratio, exact.structure, exact.sheet_structure)
    np.testing.assert_allclose(made.cauchy_green, exact.cauchy_green, rtol=1e-14)
    np.testing.assert_allclose(made.inverse, exact.inverse, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(made.log_volume, exact.log_volume, rtol=1e-12)
    np.testing.assert_allclose(made.fiber_stretch_squared, np.sum((gradients @ _FIBER) ** 2, axis=1), rtol=1e-13)
