"""The growth rate, against LAPACK's eigenvalues of the contact-closed system (1) in nodal coordinates."""

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes import chain, heavy_chain, poles_in_contact
from sliding import random_structure
from workflow.models import Rayleigh, Structure, analyse_contacts, critical_alpha, growth_of_sets, growth_rate, worst
from workflow.reduction import reduce_structure


@st.composite
def scenes(draw: st.DrawFn) -> tuple[Structure, float]:
    """A rough chain, perhaps with broken springs or without conduction, and a coupling about the critical one."""
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    n, decades = draw(st.integers(2, 12)), draw(st.sampled_from([0.3, 2.0]))

    def rough(middle: float) -> np.ndarray:
        return middle * 10 ** rng.uniform(-decades, decades, n)

    springs, conduction = rough(1e6), rough(0.1)
    if draw(st.booleans()):
        springs[rng.integers(0, n)] = 0.0
    if draw(st.booleans()):
        conduction[rng.integers(0, n)] = 0.0
    structure = chain(
        nodes=n,
        mass=rough(1e-3),
        stiffness=springs,
        damping=Rayleigh(draw(st.sampled_from([0.0, 10.0, 1e3])), draw(st.sampled_from([0.0, 1e-6, 1e-3]))),
        spacing=1e-2,
        expansion=rough(1e-5),
        heat_capacity=rough(draw(st.sampled_from([1e-5, 1e-3, 1.0]))),
        conductance=conduction,
        convection=rough(1e-3) * draw(st.sampled_from([0.0, 1.0])),
    )
    critical = critical_alpha(structure)
    share = draw(st.sampled_from([0.0, 0.1, 0.9, 1.0, 1.1, 10.0, 1e4]))
    return structure, share * (critical if 0 < critical < np.inf else 1.0)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(scenes())
def test_against_nodal_coordinates(scene: tuple[Structure, float]) -> None:
    structure, alpha = scene
    exact = poles_in_contact(structure, [0], alpha)
    splits = (
        analyse_contacts(structure).frequency[0] == 0
    )  # LAPACK splits the double zero of a rigid part by its rounding's root
    near = (1e-7 if splits else 1e-9) * np.abs(exact).max()
    assert abs(growth_rate(structure, alpha) - exact.real.max()) <= near
    assert abs(growth_rate(structure.matrices(), alpha) - exact.real.max()) <= near


@pytest.mark.parametrize("nodes", [3, 4, 7])
@pytest.mark.parametrize(("mass", "stiffness"), [(10.0, 0.1), (1e3, 1e-3), (1e4, 1e-4)])
@pytest.mark.parametrize("share", [0.2, 0.9, 4.0])
def test_poles_that_contact_cannot_see(nodes: int, mass: float, stiffness: float, share: float) -> None:
    """With a_M a_K = 1 every mode has the pole -a_M, whatever the contact heat; above α_c one grows."""
    lumps = {"mass": 1e-3, "stiffness": 1e6, "spacing": 0.01, "expansion": 1e-5, "heat_capacity": 1e-5}
    structure = chain(nodes=nodes, **lumps, conductance=0.1, damping=Rayleigh(mass, stiffness))
    alpha = share * critical_alpha(structure)
    exact = poles_in_contact(structure, [0], alpha)
    rate = growth_rate(structure, alpha)
    assert rate >= -mass * (1 + 1e-9)
    assert rate == pytest.approx(exact.real.max(), rel=1e-6, abs=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("nodes", [2, 3, 6])
@pytest.mark.parametrize("cooling", [0.0, 1e-9])
def test_heat_that_moves_mechanical_poles_and_not_its_own(nodes: int, cooling: float) -> None:
    """A free chain whose tip keeps its heat: G = t²/s Σ κ_j L_j s²/(s² + ω_j²) has no pole at s = 0."""
    springs, conduction = np.linspace(1e6, 6e5, nodes), np.linspace(0.2, 0.1, nodes)
    springs[0] = conduction[-1] = 0.0
    heat = {"expansion": 1e-5, "heat_capacity": 1e-5, "conductance": conduction, "convection": cooling}
    structure = chain(nodes=nodes, mass=1e-3, stiffness=springs, spacing=0.01, **heat)
    exact = poles_in_contact(structure, [0], 0.1).real.max()
    assert exact > 5
    assert growth_rate(structure, 0.1) == pytest.approx(exact, rel=1e-9)
    assert growth_rate(structure.matrices(), 0.1) == pytest.approx(exact, rel=1e-9)
    damping = Rayleigh(0.0, 1e-5)
    damped = chain(nodes=nodes, mass=1e-3, stiffness=springs, spacing=0.01, damping=damping, **heat)
    assert growth_rate(damped, 1e-3) == pytest.approx(-cooling / 1e-5, rel=1e-9, abs=0)


def test_the_only_pole_is_zero() -> None:
    """One node that keeps its heat: C θ' = α k a ℓ θ/2."""
    one = chain(nodes=1, mass=1e-3, stiffness=1e6, spacing=0.01, expansion=1e-5, heat_capacity=2.0)
    assert growth_rate(one, 3.0) == pytest.approx(3.0 * 1e6 * 1e-7 / 2 / 2.0, rel=1e-12)


def damped_by_a_ratio() -> Structure:
    return heavy_chain(nodes=6, damping=Rayleigh(ratio=0.2))


OTHERS: dict[str, Callable[[], Structure]] = {
    "slides": lambda: random_structure(np.random.default_rng(0), 4),
    "ratio": damped_by_a_ratio,
    "ratio, reduced": lambda: reduce_structure(damped_by_a_ratio(), 3, 4).structure,
}
"""A casing that slides, and damping that couples the modes of the held tip."""


@pytest.mark.parametrize("kind", OTHERS)
def test_bits_of_a_case_do_not_depend_on_the_others(kind: str) -> None:
    """From couplings that shift no pole to those that shift all."""
    basis, rng = analyse_contacts(OTHERS[kind]()), np.random.default_rng(0)
    alpha = np.append([0.0, 0.0], 10 ** rng.uniform(-15, 6, 1000))
    friction = np.where(rng.random(alpha.size) < 0.5, 0.0, 0.4) if basis.contacts.slides else np.zeros(alpha.size)
    (together,) = growth_of_sets(basis, alpha, friction).values()
    for k in range(0, alpha.size, 20):
        (alone,) = growth_of_sets(basis, alpha[k : k + 1], friction[k : k + 1]).values()
        assert (alone.rate[0], alone.uncertainty[0]) == (together.rate[k], together.uncertainty[k])


@pytest.mark.parametrize("decades", [6, 12])
def test_critical_coupling_of_graded_chains(decades: int) -> None:
    """α_c = Σ 1/k / β with β = Σ a ℓ_i (θ_{i-1} + θ_i)/2 at unit heat, in exact fractions."""
    n = 20
    springs = np.logspace(decades - 3, -3, n)
    conduction = np.logspace(-2, 2, n)
    structure = chain(nodes=n, mass=1.0, stiffness=springs, spacing=1.0, expansion=1e-5, conductance=conduction)
    theta, growth_per_heat = Fraction(0), Fraction(0)
    for conductance in conduction:
        before, theta = theta, theta + 1 / Fraction(float(conductance))
        growth_per_heat += Fraction(1e-5) * (before + theta) / 2
    exact = float(sum(1 / Fraction(float(k)) for k in springs) / growth_per_heat)
    assert critical_alpha(structure) == pytest.approx(exact, rel=1e-14)
    assert critical_alpha(reduce_structure(structure, 3, 5).structure) == pytest.approx(exact, rel=1e-9)


def test_zero_eigenvalues_are_no_growth() -> None:
    """Free root and no way out for heat: K1 and K2 are singular, nothing grows and nothing runs away."""
    structure = chain(
        nodes=5, mass=1.0, stiffness=(0.0, 5.0, 5.0, 5.0, 5.0), spacing=0.1, expansion=1e-3,
        conductance=(0.0, 1.0, 1.0, 1.0, 1.0), damping=Rayleigh(1.0, 0.0),
    )  # fmt: skip
    for alpha in (0.0, 0.1, 10.0):
        for form in (structure, structure.matrices(), reduce_structure(structure, 4, 4).structure):
            _, found = worst(growth_of_sets(analyse_contacts(form), np.array([alpha]), np.zeros(1)))
            assert found.rate == 0.0
            assert not found.is_positive


def test_one_node_at_its_critical_coupling() -> None:
    """The only eigenvalue is μ (α/α_c - 1): rounding of μ is not growth."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        heat = {"heat_capacity": 10 ** rng.uniform(-9, 0), "conductance": 10 ** rng.uniform(-3, 6)}
        one = chain(nodes=1, mass=1e-3, stiffness=10 ** rng.uniform(3, 9), spacing=1e-2, expansion=1e-5, **heat)
        _, fastest = worst(growth_of_sets(analyse_contacts(one), np.array([critical_alpha(one)]), np.zeros(1)))
        assert abs(fastest.rate) <= fastest.uncertainty
