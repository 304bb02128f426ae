"""Contacts without mass in fixed steps, one too, and an elastic casing: what they are limits of, rest, any θ."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import drawn
from scenes_of_contacts import pressed, two_masses

from scenes import cases_of_file, movable, sampling, step
from workflow.models import Array, Cases, Structure, at_rest
from workflow.schemes import Results

H = 4e-5
EVERY_STEP = sampling(150 * H, H)


def residual(structure: Structure, flexibility: Array) -> Structure:
    return replace(structure, contacts=replace(structure.contacts, residual=flexibility))


def on_elastic_casing(flexibility: float, structure: Structure, cases: Cases, **options: Any) -> Results:
    return step(structure.on_casing(flexibility), cases, H, EVERY_STEP, "moreau", **options)


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_an_elastic_casing_is_a_residual_that_the_displacement_does_not_have(seed: int, theta: float) -> None:
    """x = d + cλ in the place of x = d, with the same forces; beside a residual R it is R + c."""
    case, c = drawn(seed), 3e-6
    structure, cases = case.structure, case.cases
    m = structure.contacts.count
    for own in (np.zeros((m, m)), 2e-6 * np.eye(m)):
        given = residual(structure, own) if own.any() else structure
        elastic = on_elastic_casing(c, given, cases, theta=theta)
        flexible = step(residual(structure, own + c * np.eye(m)), cases, H, EVERY_STEP, theta=theta)
        scale = flexible.histories["impulse"].max()
        assert scale > 0
        for name in ("impulse", "velocity", "temperature"):
            np.testing.assert_allclose(elastic.histories[name], flexible.histories[name], rtol=0, atol=1e-9)
        forces = np.diff(flexible.histories["impulse"], axis=-1, prepend=0) / H
        place = flexible.histories["displacement"] + c * forces
        np.testing.assert_allclose(elastic.histories["displacement"], place, rtol=0, atol=1e-12)
        np.testing.assert_allclose(elastic.metrics["max_penetration"], c * forces.max(axis=-1), atol=1e-12)
        assert elastic.metrics["impacts"].tolist() == [[0.0] * m]
        assert theta == 1.0 or abs(elastic.metrics["energy_residual"][0]) < 1e-12


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_a_spring_before_contacts_without_mass_starts_pressed_and_stays(theta: float) -> None:
    """λ = (f - k d)/(1 + k (R + 1/κ)), x = d + λ/κ, from the start on."""
    kappa, over = 1e7, sampling(0.1, 1e-3)
    structure = two_masses(residual_flexibility=1e-6 * np.eye(2))
    yields = two_masses(residual_flexibility=(1e-6 + 1 / kappa) * np.eye(2))
    case = at_rest(yields, pressed(yields))
    options = {"integration": "implicit", "stiffness": kappa, "theta": theta}
    ours = step(structure, case, 1e-3, over, "penalty", **options)
    force = (np.array([30.0, 50.0]) - 1e4 * 1e-3) / (1 + 1e4 * (1e-6 + 1 / kappa))
    place = np.repeat((1e-3 + force / kappa)[:, None], over.count, axis=1)
    np.testing.assert_allclose(ours.histories["displacement"][0], place, rtol=1e-9)
    np.testing.assert_allclose(ours.histories["impulse"][0], force[:, None] * over.times, rtol=1e-9, atol=1e-15)


def test_a_static_start_of_contacts_without_mass_takes_residuals_and_the_mean_load() -> None:
    """λ = (f/k + ρ F - d)/(1/k + R) of the contact that is pressed; the other has x = f/k + ρ F - R λ < d."""
    residual = {"residual_flexibility": 1e-5 * np.array([[2.0, 1.0], [1.0, 3.0]])}
    structure = two_masses(**residual, residual_load=np.array([2e-4, -1e-4]), load=np.array([1.0, 0.5]))
    F, gaps, times = 10.0, [1e-3, 2e-3], np.linspace(0, 0.1, 11)
    case = at_rest(structure, movable(cases_of_file(structure, steady=[30.0, 5.0], mean=F, gaps=gaps)))
    force = ((30.0 + F) / 1e4 + 2e-4 * F - gaps[0]) / (1e-4 + 2e-5)
    aside = (5.0 + 0.5 * F) / 1e4
    np.testing.assert_allclose(
        structure.coordinates.displacement_basis @ case.displacement[0], [(40.0 - force) / 1e4, aside], rtol=1e-12
    )
    place = np.array([gaps[0], aside - 1e-4 * F - 1e-5 * force])
    for method in ("event_driven", "moreau"):
        ours = step(structure, case, 1e-3, sampling(0.1, 0.01), method)
        np.testing.assert_allclose(ours.histories["impulse"][0], np.outer([force, 0.0], times), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(ours.histories["displacement"][0], place[:, None] + 0 * times, rtol=1e-9)
