"""An abradable coating in steps and at rest: closed forms, another solver's scenes, plain matrices, what may not be."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from random_contacts import varied

from plain_steps import CoatedCasing, march, results
from scenes import cases, chain, coated, of_entries, sampling, step
from workflow.models import Cases, NoEquilibriumError, Rayleigh, Structure, at_rest
from workflow.schemes import HISTORIES, ContractError, Status, load, refuse

SCENES = Path(__file__).parent / "coating"


BOTH = pytest.mark.parametrize("method", ["moreau", "event_driven"])


def free_mass(flexibility: float = 1.0) -> Structure:
    return chain(nodes=1, mass=1.0, stiffness=0.0).on_casing(flexibility)


@BOTH
def test_a_coating_that_does_not_yield_is_the_elastic_casing(method: str) -> None:
    """To the bit at any yield force above the contact's; where it hardens with 1e10 k at once by F_y/H, 1e-9 of x."""
    rod = chain(nodes=3, mass=0.1, stiffness=4000.0, spacing=0.1, expansion=1e-3, heat_capacity=5.0, conductance=0.5)
    rod, over = rod.on_casing(2e-5), sampling(0.2, 1e-3)
    batch = cases(rod, alpha=0.5, gap=1e-3, amplitude=4.0, frequency=12.0, casing_harmonics=[[2e-4, 31.0, 0.3]])
    alone = step(rod, batch, 1e-4, over, method)
    coats = coated(rod, batch, 1e6, 8, speed=40.0), coated(rod, batch, 1e-3, 8, speed=40.0, hardening=1e10 / 2e-5)
    strong, hard = (step(rod, one, 1e-4, over, method) for one in coats)
    within = 1e-8 if method == "moreau" else 1e-9
    assert alone.metrics["contact_time"] > 0.01
    for name in HISTORIES:
        np.testing.assert_array_equal(strong.histories[name], alone.histories[name])
        scale = np.abs(alone.histories[name]).max()
        np.testing.assert_allclose(hard.histories[name], alone.histories[name], rtol=0, atol=within * scale)
    for name in ("steps", "contact_time", "max_temperature"):
        assert strong.metrics[name] == alone.metrics[name]
    assert not strong.wear["worn_depth"].any()
    assert strong.metrics["border_work"] == 0
    assert (hard.wear["worn_depth"] > 0).any()


H, OVER = 4e-5, sampling(0.006, 5e-5, balances=False)
"""Without balances, as studies of several contacts are unless they ask for them: they share a kernel."""
FLEXIBILITY = 4e-7


def random_case(seed: int) -> tuple[Structure, Cases]:
    """Return one of the random structures on a casing with a coating of few or many sectors."""
    case, rng = varied(seed, massless=seed % 2 == 1), np.random.default_rng(1000 + seed)
    structure = case.structure
    structure = replace(structure, contacts=replace(structure.contacts, casing_flexibility=FLEXIBILITY))
    coat = {"hardening": rng.choice([0.0, 1e5, 1e6]), "speed": rng.uniform(100, 400)}
    return structure, coated(structure, case.cases, rng.uniform(0.2, 2.0), rng.choice([1, 7, 90, 360]), **coat)


@pytest.mark.parametrize("seed", [pytest.param(k, marks=pytest.mark.slow if k >= 16 else ()) for k in range(64)])
def test_it_is_worn_as_in_plain_matrices(seed: int) -> None:
    structure, one = random_case(seed)
    theta, law = (0.5, 0.6, 1.0)[seed // 3 % 3], CoatedCasing(one, H, FLEXIBILITY)
    ours = step(structure, one, H, OVER, theta=theta)
    truth = results(structure, H, one, OVER, lambda c, n: march(structure, c, H, theta, n, law, FLEXIBILITY))
    assert ours.status.tolist() == [Status.OK], ours.messages
    for name in HISTORIES:
        values = truth.histories[name]
        within = 1e-8 * np.abs(values).max()
        np.testing.assert_allclose(ours.histories[name], values, rtol=0, atol=within, err_msg=name)
    worn = np.reshape(ours.wear["worn_depth"], law.worn.shape)
    np.testing.assert_allclose(worn, law.worn, rtol=0, atol=1e-8 * max(law.worn.max(), 1e-9))


def holds(seed: int, method: str) -> bool:
    """Check a random structure; return whether its coating is worn."""
    structure, one = random_case(seed)
    own, over = one.coating, replace(sampling(0.02, H, balances=False), wear_every=1)
    assert own is not None
    done = step(structure, one, H, over, method)
    force = np.diff(done.histories["impulse"].reshape(-1, over.count)) / H
    worn = done.wear["worn_depth"].reshape(len(force), -1)
    mapped = done.wear["wear_map"].reshape(len(force), -1, worn.shape[1])
    level = own.yield_force[0] + own.hardening[0] * worn.max(axis=1)
    assert done.status.tolist() == [Status.OK], (seed, done.messages)
    assert force.min() >= 0, seed
    assert (force.max(axis=1) <= level * (1 + (1e-9 if method == "moreau" else 1e-12))).all(), seed
    assert (np.diff(np.concatenate([mapped, worn[:, None]], axis=1), axis=1) >= 0).all(), seed
    return bool(worn.max() > 0)


@BOTH
def test_forces_stay_below_their_level_and_no_depth_falls(method: str) -> None:
    assert sum(holds(seed, method) for seed in range(100, 130)) > 20


@pytest.mark.slow
def test_no_random_structure_goes_astray() -> None:
    """1 to 5 contacts, with and without mass, friction, heat, hardening or none, 1 to 360 sectors."""
    assert sum(holds(seed, "event_driven") for seed in range(120, 400)) > 220


@BOTH
def test_a_rigid_blade_cuts_once(method: str) -> None:
    """Max(0, (k (x - d) - F_y)/(k + H)) with d the least that the blade meets in a sector, in one revolution."""
    k, first, hardening, sectors, speed, h = 1e6, 2.0, 5e5, 12, 50.0, 2e-5
    rigid = chain(nodes=1, mass=1e-3, stiffness=1e13).on_casing(1 / k)
    batch = cases(rigid, gap=-4e-6, casing_harmonics=[[6e-6, 2 * speed, 0.3]])
    over = replace(sampling(0.06, 1e-3), wear_every=1)
    done = step(rigid, coated(rigid, batch, first, sectors, hardening=hardening, speed=speed), h, over, method)
    turns = np.arange(round(1 / speed / h)) / round(1 / speed / h)  # of the ends of steps
    if method == "event_driven":
        turns = np.linspace(1e-12, 1 - 1e-12, 10001) / sectors + np.arange(sectors)[:, None] / sectors
    least = np.full(sectors, np.inf)
    within = (sectors * turns + 1e-9 * (method == "moreau")).astype(int)
    np.minimum.at(least, within, -4e-6 + 6e-6 * np.sin(4 * np.pi * turns + 0.3))
    expected = np.maximum(0.0, (-k * least - first) / (k + hardening))
    assert 0 < (expected > 0).sum() < sectors
    for depth in (done.wear["worn_depth"][0], *done.wear["wear_map"][0]):
        np.testing.assert_allclose(depth, expected, rtol=1e-5 if method == "moreau" else 0, atol=1.5e-12)  # it yields


@BOTH
def test_a_load_of_n_times_the_speed_wears_n_lobes(method: str) -> None:
    """It goes on deeper at first, and there is a lobe in each third of the angle."""
    mass, speed = chain(nodes=1, mass=1e-3, stiffness=1e5, damping=Rayleigh(mass=1e4)).on_casing(1e-6), 100.0
    batch = cases(mass, gap=1e-5, amplitude=3.0, frequency=3 * speed, phase=-np.pi / 2)
    done = step(mass, coated(mass, batch, 0.5, 60, hardening=1e5, speed=speed), 1e-6, sampling(0.05, 0.01), method)
    depth = done.wear["worn_depth"].reshape(3, 20)
    np.testing.assert_allclose(depth, depth[:1].repeat(3, axis=0), rtol=0.02, atol=1e-9)
    assert depth[0].max() > 1e-6
    assert depth[0].min() == 0


def test_balances_close_with_the_work_at_borders() -> None:
    """Contact takes from a structure what the casing holds in the end and what crushed it, less border_work."""
    c, speed = 1e-6, 100.0
    mass = chain(nodes=1, mass=1e-3, stiffness=1e5).on_casing(c)
    batch = cases(mass, gap=1e-5, mean=2.0, amplitude=3.0, frequency=270.0)
    batch = coated(mass, batch, 0.5, 24, hardening=1e5, speed=speed)

    def apart(h: float) -> tuple[float, float]:
        done = step(mass, batch, h, sampling(0.04, h), theta=0.5)
        force = np.diff(done.histories["impulse"][0]) / h
        x, own = done.histories["displacement"][0], batch.coating
        assert own is not None
        assert abs(done.metrics["energy_residual"][0]) < 1e-9
        worn = done.wear["worn_depth"][:, None]
        taken = np.sum(force * np.diff(x)) - 0.5 * c * force[-1] ** 2
        crushed, border = float(own.crushing_work(worn)[0, 0]), float(done.metrics["border_work"][0])
        assert border > 0.1 * crushed > 0
        return taken - (crushed - border), crushed

    (coarse, _), (fine, crushed) = apart(1e-6), apart(5e-7)
    assert abs(fine) < 0.01 * crushed
    np.testing.assert_allclose(coarse / fine, 2.0, rtol=0.2)


@BOTH
@pytest.mark.parametrize("start", ["static", "pressed"])
def test_a_pressed_start_yields_at_once(start: str, method: str) -> None:
    """Static: f = k x + F_y + H w with w = x - d - c λ; else w = (k (x - d) - F_y)/(k + H) at t = 0."""
    k, c, d, first, hardening, f = 4000.0, 2e-4, 1e-3, 2.0, 1e3, 20.0
    mass = chain(nodes=1, mass=0.1, stiffness=k).on_casing(c)
    x = (f - (first - hardening * d) / (1 + hardening * c)) / (k + hardening / (1 + hardening * c))
    batch = coated(mass, cases(mass, gap=d, mean=f, displacement=x), first, 4, speed=1.0, hardening=hardening)
    if start == "static":
        batch = at_rest(mass, replace(batch, displacement=0 * batch.displacement))
        np.testing.assert_allclose(batch.displacement, x, rtol=1e-12)
    done = step(mass, batch, 1e-3, sampling(0.1, 0.01), method)
    np.testing.assert_allclose(done.histories["displacement"][0], x, rtol=1e-12)
    force = f - k * x
    np.testing.assert_allclose(done.histories["impulse"][0], force * np.linspace(0, 0.1, 11), rtol=1e-11)
    np.testing.assert_allclose(done.wear["worn_depth"][0], [x - d - c * force, 0, 0, 0], rtol=1e-11)


@BOTH
def test_several_contacts_yield_together_at_rest(method: str) -> None:
    """Of two contacts without mass one crushes, one does not, and one is open: each is in its state."""
    entries = {
        "mass": np.eye(3), "stiffness": 1e4 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]]), "contact": np.eye(3),
        "load": np.array([1.0, 1.5, -1.0]), "residual_flexibility": 1e-6 * np.eye(3),
    }  # fmt: skip
    structure = of_entries(entries).on_casing(2e-6)
    batch = cases(structure, gaps=[1e-4, 3e-3, 1e-4], mean=40.0)
    resting = at_rest(structure, coated(structure, batch, 15.0, hardening=2e5))
    done = step(structure, resting, 1e-4, sampling(0.01, 1e-3, balances=False), method)
    x, worn = done.histories["displacement"][0, :, 0], done.wear["worn_depth"][0, :, 0]
    force = done.histories["impulse"][0, :, -1] / 0.01
    np.testing.assert_allclose(done.histories["displacement"][0], x[:, None].repeat(11, axis=1), rtol=1e-9)
    np.testing.assert_allclose(force, np.maximum(0, x - batch.gaps[0] - worn) / 2e-6, rtol=1e-8, atol=1e-8)
    assert force[0] > 15
    np.testing.assert_allclose(force[worn > 0], 15 + 2e5 * worn[worn > 0], rtol=1e-8)
    assert (force <= 15 + 2e5 * worn + 1e-8).all()


@pytest.mark.parametrize("method", ["carpenter", "paoli_schatzman", "penalty"])
def test_other_schemes_refuse_it(method: str) -> None:
    mass = free_mass()
    with pytest.raises(ContractError, match="does not take a casing with a coating"):
        refuse(load(method), coated(mass, cases(mass), 1.0))


@BOTH
def test_a_free_body_rests_on_a_coating_that_hardens(method: str) -> None:
    """5 N on 2 N + H w: w = 3 mm at 1000 N/m, and x = d + w + c λ; without hardening it crushes for ever."""
    body, c = free_mass(1e-4), 1e-4
    batch = cases(body, gap=1e-3, mean=5.0)
    resting = at_rest(body, coated(body, batch, 2.0, hardening=1e3))
    np.testing.assert_allclose(resting.displacement, 1e-3 + 3e-3 + 5 * c, rtol=1e-12)
    done = step(body, resting, 1e-4, sampling(0.01, 1e-3), method)
    np.testing.assert_allclose(done.histories["displacement"][0], resting.displacement[0, 0], rtol=1e-12)
    np.testing.assert_allclose(done.wear["worn_depth"], 3e-3, rtol=1e-12)
    with pytest.raises(NoEquilibriumError, match="crush the coating for ever"):
        at_rest(body, coated(body, batch, 2.0))
