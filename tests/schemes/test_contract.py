"""One acceptance test that every scheme in the directory passes unasked."""

from dataclasses import asdict, replace
from itertools import product
from operator import attrgetter
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from scenes import WAVES, cases, chain, heavy_chain, relative, rubs, same_bits, sampling, step, taken, with_dashpot
from workflow import schemes
from workflow.models import Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Cases, Status

METHODS = schemes.names()
STEPPING = tuple(name for name in METHODS if "h" in schemes.load(name).READS)
OVER = sampling(0.1, 1e-3)
H = 1e-5
"""A step at which every scheme is stable on the heavy chain, explicit ones too (limit 1.12e-5 s)."""


def coupled() -> tuple[Structure, Cases]:
    """Modes that damping couples, under constant loads, on a moving casing; each case has load periods of its own."""
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
    waves = {name: [[0.1 * a, f, phase] for a, f, phase in rows] for name, rows in WAVES.items()}
    frequency = 50 * rubs(structure, 40).e + 150
    batch = rubs(structure, 40, amplitude=400.0, frequency=frequency, phase=0.0, **waves)
    return structure, replace(batch, steady=batch.e[:, None] * np.linspace(-3.0, 7.0, structure.mechanical_size))


def kinds() -> dict[str, tuple[Structure, Cases]]:
    """Structures of many modes, whose packs are narrow, and of few; reduced; coupled."""
    full, short = heavy_chain(), heavy_chain(nodes=6)
    reduction = reduce_structure(full, 3, 12)
    return {
        "many modes": (full, rubs(full, 40)),
        "few modes": (short, rubs(short, 40, amplitude=3 * rubs(short, 40).load_harmonics.amplitude[:, 0])),
        "reduced": (reduction.structure, reduction.project(rubs(full, 40))),
        "coupled": coupled(),
    }


IMPLICIT = ("penalty", {"integration": "implicit", "damping": 5.0})


@pytest.mark.parametrize(
    ("method", "options", "kind"),
    [
        *((method, {}, kind) for method in METHODS for kind in ("many modes", "few modes")),
        (*IMPLICIT, "many modes"),
        *(("moreau", {"theta": 0.5}, kind) for kind in ("reduced", "coupled")),
        ("event_driven", {}, "coupled"),
    ],
)
def test_alone_is_as_in_a_batch(method: str, options: dict[str, Any], kind: str) -> None:
    structure, batch = kinds()[kind]
    whole = step(structure, batch, H, OVER, method, **options)
    assert np.all(whole.status == Status.OK)
    assert whole.metrics["impacts"].min() > 0
    assert method == "event_driven" or np.count_nonzero(whole.metrics["energy_residual"]) > 20
    for part in (*(slice(i, i + 1) for i in range(batch.count)), slice(5, 12)):
        assert same_bits(step(structure, batch.take(part), H, OVER, method, **options), taken(whole, part))


@pytest.mark.parametrize("method", METHODS)
def test_a_tip_at_minus_zero_on_its_casing_is_not_a_matter_of_its_place(method: str) -> None:
    batch = cases(heavy_chain(), 9, gap=0.0, amplitude=-1.0, frequency=20.0)
    batch.displacement[:, -1] = -0.0
    over = sampling(1e-3, 1e-3)  # it leaves at once
    deepest = step(heavy_chain(), batch, H, over, method).metrics["max_penetration"]
    alone = step(heavy_chain(), batch.take(slice(0, 1)), H, over, method).metrics["max_penetration"]
    assert not np.any(deepest)
    assert np.array_equal(np.signbit(deepest), np.repeat(np.signbit(alone), 9))


@pytest.mark.parametrize(("method", "options"), [*((method, {}) for method in METHODS), IMPLICIT])
def test_a_poisoned_neighbour_changes_nothing(method: str, options: dict[str, Any]) -> None:
    batch = rubs(heavy_chain(), 6)
    clean = step(heavy_chain(), batch, H, OVER, method, **options)
    poisons = [("velocity", np.nan), ("temperature", np.inf), ("load_harmonics.amplitude", np.nan), ("velocity", 1e300)]
    poisons += [("e", np.nan)] if method in ("moreau", "event_driven") else []
    for name, poison in poisons:
        sick = batch.take(np.arange(6))
        attrgetter(name)(sick)[3] = poison
        results = step(heavy_chain(), sick, H, OVER, method, **options)
        if not np.isfinite(poison):
            assert results.status[3] != Status.OK
            assert results.messages[3]
            assert np.isnan(results.histories["displacement"][3, -1])
            assert np.isnan([results.metrics[name][3] for name in ("energy_residual", "heat_residual")]).all()
        for part in (slice(0, 3), slice(4, 6)):
            assert same_bits(taken(results, part), taken(clean, part))


@pytest.mark.parametrize("method", METHODS)
def test_an_axis_it_does_not_read_changes_nothing(method: str) -> None:
    batch = rubs(heavy_chain(), 6)
    reads = schemes.load(method).READS
    whole = step(heavy_chain(), batch, H, OVER, method)
    if "h" not in reads:
        assert same_bits(step(heavy_chain(), batch, 10 * H, OVER, method), whole)
    for name in {"e", "alpha"} - reads:
        other = replace(batch, **{name: getattr(batch, name) / 2 + 0.1})
        assert same_bits(step(heavy_chain(), other, H, OVER, method), whole)
    for name in {"e", "alpha"} & reads:
        other = replace(batch, **{name: getattr(batch, name) / 2 + 0.1})
        assert not same_bits(step(heavy_chain(), other, H, OVER, method), whole)


@pytest.mark.parametrize("method", METHODS)
def test_a_tip_that_stays_pressed_is_in_contact_in_the_whole_of_each_load_period(method: str) -> None:
    """At rest under its load, which the casing carries; periods end within steps."""
    lump, rigid = chain(nodes=1, mass=1.0, stiffness=0.0), schemes.load(method).rigid
    options = {} if rigid is None else asdict(rigid(lump, 1e-2))
    depth = 3.0 / options.get("stiffness", np.inf)
    batch = cases(lump, 9, mean=3.0, frequency=np.linspace(7.0, 8.0, 9), displacement=depth)
    results = step(lump, batch, 1e-2, sampling(1.0, 0.25), method, **options)
    contact, force = results.period_contact, results.period_impulse * batch.period_frequency[:, None]
    assert np.all(np.sum(~np.isnan(contact), axis=1) >= 7)
    np.testing.assert_allclose(contact[~np.isnan(contact)], 1.0, rtol=1e-12)
    assert np.all(np.nansum(results.sections["period_impacts"], axis=1) <= results.metrics["impacts"])
    np.testing.assert_allclose(force[~np.isnan(contact)], 3.0, rtol=1e-12 if rigid is None else 1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_load_periods_add_up_to_the_whole(method: str) -> None:
    batch = rubs(heavy_chain(), 8)
    results = step(heavy_chain(), batch, H, OVER, method)
    whole = results.metrics
    assert whole["impacts"].min() > 1
    assert np.array_equal(results.sections["period_impacts"].sum(axis=1), whole["impacts"])
    contact = results.period_contact.sum(axis=1) / batch.period_frequency
    np.testing.assert_allclose(contact, whole["contact_time"], rtol=1e-12)
    np.testing.assert_allclose(results.period_impulse.sum(axis=1), results.histories["impulse"][:, -1], rtol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_load_periods_that_end_within_steps(method: str) -> None:
    """Each is as warm as at its warmer end, of lumps in flight that are heated and cooled, colder than the root."""
    lump = chain(nodes=1, mass=1.0, stiffness=0.0, heat_capacity=2.0, conductance=0.0, spacing=1.0, expansion=0.0)
    batch = cases(lump, 2, mean=-3.0, frequency=7.3, heating=[[3.0], [-3.0]], temperature=[[-4.0], [-1.0]])
    options = {} if schemes.load(method).rigid is None else {"stiffness": 1.0}
    results, ends = step(lump, batch, 1e-2, sampling(1.0, 0.25), method, **options), np.arange(8) / 7.3
    np.testing.assert_allclose(results.sections["section_velocity"][:, :7], [-3.0 * ends[:7]] * 2, atol=1e-12)
    np.testing.assert_allclose(results.period_temperature, [1.5 * ends[1:] - 4.0, -1.5 * ends[:-1] - 1.0], rtol=1e-12)
    np.testing.assert_allclose(results.metrics["max_temperature"], [-2.5, -1.0], rtol=1e-12)


ORDERS = {"moreau": (0.9, 1.1, 2e-3), "moreau 1/2": (1.9, 2.1, 2e-6)}
"""Least and largest order, and the largest error at 2.5e-4 s; of other schemes one at least."""


@pytest.mark.parametrize("method", [*METHODS, "moreau 1/2"])
def test_smooth_motion_against_the_matrix_exponential(method: str) -> None:
    """Without contact: exact, or converging with order one at least."""
    structure = chain(nodes=3, mass=1.0, stiffness=40.0, damping=Rayleigh(0.1, 1e-3))
    start, n = np.array([0.1, 0.3, 0.2]), 3
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:, :n] = -np.linalg.solve(structure.mass, structure.stiffness_matrix)
    A[n:, n:] = -np.linalg.solve(structure.mass, structure.damping_matrix)
    exact = (expm(A) @ np.concatenate([start, np.zeros(n)]))[n - 1]
    batch = cases(structure, gap=10.0, displacement=start)
    sizes, over = np.array([1e-3, 5e-4, 2.5e-4]), sampling(1.0, 0.1)
    name, options = ("moreau", {"theta": 0.5}) if method == "moreau 1/2" else (method, {})
    ends = [step(structure, batch, h, over, name, **options).histories["displacement"][0, -1] for h in sizes]
    errors = np.abs(np.array(ends) - exact)
    if name not in STEPPING:
        assert errors.max() < 1e-12
        return
    least, most, largest = ORDERS.get(method, (0.9, np.inf, 2e-3))
    assert errors[-1] < largest
    assert least < np.polyfit(np.log(sizes), np.log(errors), 1)[0] < most


@pytest.mark.parametrize("method", STEPPING)
def test_contact_converges_to_the_exact_solution(method: str) -> None:
    """A thousand times smaller a step: at least ten times smaller an error in every history, of an impact with e too.

    A scheme of a compliant casing says with which options it approaches a rigid one as h → 0.
    """
    structure = heavy_chain()
    e = [0.0, 0.5 if "e" in schemes.load(method).READS else 0.0]
    batch = cases(structure, 2, e=e, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    exact = step(structure, batch, H, OVER, "event_driven").histories
    rigid = schemes.load(method).rigid

    def histories(h: float) -> dict[str, np.ndarray]:
        options = {} if rigid is None else asdict(rigid(structure, h))
        return step(structure, batch, h, OVER, method, **options).histories

    coarse, fine = histories(H), histories(H / 1000)
    for case, name in product(range(2), ("displacement", "temperature", "impulse")):
        errors = [relative(each[name][case], exact[name][case]) for each in (coarse, fine)]
        assert errors[1] < min(0.1 * errors[0], 1e-3), (case, name)
