"""Contacts of the exact scheme that nothing moves, and bounces that accumulate, against closed forms."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import positive
from scipy.linalg import block_diag

from scenes import cases_of_file, of_entries, step, with_tip_first
from workflow.models import NoEquilibriumError, at_rest
from workflow.schemes import Results, Sampling, Status
from workflow.schemes._exact import batch
from workflow.schemes._exact.events import LOWEST_BOUNCE

KINDS = ("with mass", "without mass", "elastic casing")
DURATION = 0.05


def body(rng: np.random.Generator, size: int, count: int, softness: float) -> dict[str, Any]:
    """Return a body with contacts whose damping couples its modes."""
    mass, stiffness = 0.1 * positive(rng, size, 0.5), 4e5 / softness * positive(rng, size, 0.05)
    along = rng.normal(size=size)
    return {
        "mass": mass,
        "stiffness": stiffness,
        "damping": 5.0 * mass + 2e-5 * stiffness + np.outer(along, along),
        "contact": np.eye(count, size) + 0.15 * rng.normal(size=(count, size)),
        "residual_flexibility": 4e-6 * positive(rng, count, 0.3),
    }


def rub(bodies: list[dict[str, Any]], kind: str, contacts: int, amplitude: float, e: float) -> Results:
    """Run a rub of the first body, whose loads act on it alone; the others touch their casing at rest."""
    rng, load = np.random.default_rng(3), np.zeros(sum(len(own["mass"]) for own in bodies))
    load[: len(bodies[0]["mass"])] = rng.normal(size=len(bodies[0]["mass"]))
    entries = {name: block_diag(*(own[name] for own in bodies)) for name in bodies[0]} | {"load": load}
    if kind != "without mass":
        del entries["residual_flexibility"]
    structure = of_entries(entries)
    flexibility = 3e-6 if kind == "elastic casing" else 0.0
    rows = replace(structure.contacts, casing_flexibility=flexibility)
    gaps = np.zeros(rows.count)
    gaps[:contacts] = 2e-5
    given: dict[str, Any] = {"load_harmonics": [[amplitude, 110.0, 0.4]], "mean": 2.0, "velocity": 0.02 * load}
    cases = cases_of_file(structure, gaps=gaps, e=e, **given)
    over = Sampling(DURATION, DURATION / 100, 101)
    own = replace(structure, contacts=rows)
    own = with_tip_first(own) if rows.count == 1 else own  # a tip counts bounces that it sums up otherwise
    return step(own, own.received(cases) if rows.count == 1 else cases, 0.0, over, "event_driven")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(8))
def test_a_body_at_rest_that_touches_its_casing_stays_at_rest(
    kind: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "THRESHOLDS", batch.THRESHOLDS._replace(height=LOWEST_BOUNCE))  # of one contact too
    rng = np.random.default_rng(seed)
    contacts = int(rng.integers(1, 3))
    one, e = body(rng, 3, contacts, 1.0), float(rng.choice([0.0, 0.4]))
    other, amplitude = body(rng, int(rng.integers(2, 4)), 2, 10.0 ** rng.uniform(-2, 2)), rng.uniform(3, 9)
    both, alone = (rub(bodies, kind, contacts, amplitude, e) for bodies in ([one, other], [one]))
    assert both.status[0] == Status.OK
    assert np.any(both.histories["impulse"][0, :contacts, -1] > 0)
    for name in ("displacement", "impulse"):
        ours, expected = both.histories[name][0], alone.histories[name].reshape(contacts, -1)
        assert ours[:contacts] == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
        assert np.abs(ours[contacts:]).max() <= 1e-11 * np.abs(expected).max()
    for name in ("impacts", "contact_time"):
        assert np.all(both.metrics[name][0, contacts:] == 0)
    assert both.metrics["contact_time"][0, :contacts] == pytest.approx(alone.metrics["contact_time"].ravel(), rel=1e-9)
    impacts = alone.metrics[
        "impacts"
    ].ravel()  # heights are compared with the largest motion where steps end, which differ
    assert both.metrics["impacts"][0, :contacts] == pytest.approx(impacts, abs=1)


@pytest.mark.parametrize("e", [0.2, 0.8])
def test_time_in_contact_after_bounces_that_accumulate(e: float) -> None:
    """A mass pressed by F bounces with flights 2 v e^k/F (m = 1): they last 2 v e/(F (1 - e)) in all."""
    gaps, F = np.array([0.5, 0.3]), 2.0
    own = of_entries({"mass": np.eye(2), "stiffness": np.zeros((2, 2)), "contact": np.eye(2), "load": np.ones(2)})
    done = step(own, cases_of_file(own, gaps=gaps, e=e, mean=F), 0.0, Sampling(20.0, 1.0, 21), "event_driven")
    begins = np.sqrt(2 * gaps / F) * (1 + 2 * e / (1 - e))
    assert done.metrics["contact_time"][0] == pytest.approx(20.0 - begins, rel=1e-9)
    assert done.histories["impulse"][0, :, -1] == pytest.approx(20.0 * F, rel=1e-12)


@pytest.mark.parametrize("flexibility", [0.0, 0.01])
@pytest.mark.parametrize("depth", [1e-13, 1e-12, 1e-11])
def test_a_graze_of_a_trifle_of_the_motion(depth: float, flexibility: float) -> None:
    """x = sin t would pass d = 1 - ε: the impact is (1 + e) √(2 ε), an elastic casing takes 4/3 ε √(2 ε)/c."""
    own, e = of_entries({"mass": np.eye(2), "stiffness": np.diag([1.0, 3.0]), "contact": np.eye(2)}), 0.5
    own = replace(own, contacts=replace(own.contacts, casing_flexibility=flexibility))
    gap = 1 - depth
    case = cases_of_file(own, gaps=[gap, 1.0], e=e, velocity=[1.0, 0.1])
    done = step(own, case, 0.0, Sampling(3.0, 0.1, 31, events=9), "event_driven")
    speed, rounding = np.sqrt(2 * (1 - gap)), 1e-15 / depth
    impulse = 4 / 3 * (1 - gap) * speed / flexibility if flexibility else (1 + e) * speed
    assert done.histories["impulse"][0, :, -1] == pytest.approx([impulse, 0.0], rel=4 * rounding)
    assert np.all(np.diff(done.histories["impulse"][0]) >= 0)
    assert done.metrics["impacts"][0].tolist() == [0.0 if flexibility else 1.0, 0.0]
    assert np.nanmin(done.events["event_impulse"]) >= 0
    assert done.histories["displacement"][0, 0] == pytest.approx(np.sin(np.linspace(0, 3, 31)), abs=2 * speed)


def test_a_body_that_moves_freely_rests_on_as_many_contacts_as_it_has_motions() -> None:
    """A free bar of two masses and a spring, in y too: forces at its ends balance the loads, and heat bends nothing."""
    bar = {"mass": np.diag([1.0, 3.0, 1.0]), "stiffness": 5.0 * np.outer([1, -2, 1], [1, -2, 1]), "load": np.ones(3)}
    own, gaps = of_entries(bar | {"contact": np.eye(3)[[0, 2]]}), [0.3, 0.1]
    rest = at_rest(own, cases_of_file(own, 2, gaps=gaps, mean=1.0, steady=[[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]))
    x = rest.displacement @ own.coordinates.displacement_basis.T
    assert x[:, [0, 2]] == pytest.approx(np.array([gaps, gaps]), abs=1e-15)
    assert 10.0 * (2 * x[:, 1] - x[:, 0] - x[:, 2]) == pytest.approx(np.ones(2))  # the middle carries its load
    done = step(own, rest, 0.0, Sampling(1.0, 0.5, 3), "event_driven")
    assert done.histories["impulse"][:, :, -1] == pytest.approx(np.array([[1.5, 1.5], [2.0, 1.5]]), rel=1e-9)
    with pytest.raises(NoEquilibriumError):
        at_rest(own, cases_of_file(own, gaps=gaps, mean=1.0, steady=[-2.0, 0.0, 0.0]))
