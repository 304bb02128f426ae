"""An abradable coating in the exact scheme: closed forms, another solver, energy, `moreau` as h → 0, and its limits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_coating import SCENES, free_mass, random_case

from scenes import cases, chain, coated, of_entries, sampling
from scenes import step as stepped
from workflow.models import Cases, Structure
from workflow.schemes import Results, Sampling, Status
from workflow.schemes._exact.event_loop import run_cases
from workflow.variables import EVENT_KINDS


def run(structure: Structure, batch: Cases, over: Sampling) -> Results:
    done = stepped(structure, batch, 1.0, over, "event_driven")
    assert done.status.tolist() == [Status.OK] * batch.count, done.messages
    return done


def scene(name: str) -> tuple[dict[str, Any], Structure, Cases, float]:
    """Return a scene of another solver: its results, the structure, the case and its duration."""
    file = dict(np.load(SCENES / f"{name}.npz"))
    structure = of_entries({key: file[key] for key in file if key not in ("scene", "worn", "impulse")})
    structure = structure.on_casing(file["scene"][0])
    gap, force, hardening, sectors, speed, wave, phase, mean, amplitude, frequency, begins, alpha, duration = file[
        "scene"
    ][1:]
    batch = cases(
        structure, alpha=alpha, gap=gap, mean=mean, amplitude=amplitude, frequency=frequency, phase=begins,
        casing_harmonics=[[wave, 2 * speed, phase]],
    )  # fmt: skip
    return file, structure, coated(structure, batch, force, sectors, hardening=hardening, speed=speed), duration


@pytest.mark.parametrize(
    ("hardening", "worn", "rebound", "lasts"),
    [
        (0.0, 1.5, 1.0, np.pi / 6 + np.sqrt(3) + np.pi / 2),
        (1.0, 0.5811388301, 1.5811388301, 3.3474973882),
        (1e-9, 1.5, 1.0, np.pi / 6 + np.sqrt(3) + np.pi / 2),
    ],
)
def test_a_mass_crushes_a_coating(hardening: float, worn: float, rebound: float, lasts: float) -> None:
    """1 kg at 2 m/s against k = 1 N/m, F_y = 1 N, which yields at π/6; hardening of nearly nothing loses no digit."""
    mass = free_mass()
    batch = coated(mass, cases(mass, velocity=2.0), 1.0, hardening=hardening)
    done = run(mass, batch, replace(sampling(5.0, 1.0), events=8))
    np.testing.assert_allclose(done.wear["worn_depth"], worn, rtol=2e-9)
    np.testing.assert_allclose(done.histories["impulse"][0, -1], 2.0 + rebound, rtol=2e-9)
    np.testing.assert_allclose(done.histories["velocity"][0, -1], -rebound, rtol=2e-9)
    np.testing.assert_allclose(done.metrics["max_penetration"], worn + rebound, rtol=2e-9)
    np.testing.assert_allclose(done.metrics["contact_time"], lasts, rtol=2e-9)
    kinds = [EVENT_KINDS[int(kind)] for kind in done.events["event_kind"][0, :4]]
    assert kinds == ["touches", "yields", "stops_yielding", "leaves"]
    assert done.events["event_count"] == 4
    np.testing.assert_allclose(done.events["event_time"][0, [1, 3]], [np.pi / 6, lasts], rtol=2e-9)


@pytest.mark.parametrize(
    ("name", "lasts", "warmest", "events"), [("press", 0.19856623, 0.0, 11), ("heat", 0.04790087, 19.38859742, 154)]
)
def test_it_agrees_with_another_solver(name: str, lasts: float, warmest: float, events: int) -> None:
    """Matrix exponentials, events by bisection; the second scene has heat, an oval casing and 24 sectors."""
    truth, structure, batch, duration = scene(name)
    done = run(structure, batch, replace(sampling(duration, duration), events=200))
    np.testing.assert_allclose(done.wear["worn_depth"][0], truth["worn"], rtol=0, atol=1e-9 * truth["worn"].max())
    np.testing.assert_allclose(done.histories["impulse"][0, -1], truth["impulse"], rtol=1e-9)
    np.testing.assert_allclose(done.metrics["contact_time"], lasts, rtol=2e-8)  # as many digits as are written here
    np.testing.assert_allclose(done.metrics["max_temperature"], warmest, rtol=1e-9)
    own = batch.coating
    assert own is not None
    passed = own.sectors[0] * own.speed[0] * done.events["event_time"][0, : int(done.events["event_count"][0])]
    at_border = (np.abs(passed - np.round(passed)) < 1e-9) & (passed > 0)  # which that solver does not list
    assert np.sum(~at_border) == events


def test_one_kernel_runs_one_case_and_several() -> None:
    """Its arrays have one layout: it takes 10 s to compile."""
    mass, over = free_mass(), sampling(5.0, 1.0)
    kernels = []
    for count in (1, 3):
        run(mass, coated(mass, cases(mass, count, velocity=2.0), 1.0), over)
        kernels.append(len(run_cases.dispatcher.signatures))
    assert kernels[0] == kernels[1]


def plain_energy(structure: Structure, x: Any, v: Any, force: Any, load: Any) -> float:
    """Return the energy of a structure without damping and its casing, less that of the constant load, J."""
    stored = x @ structure.stiffness_matrix @ x + v @ structure.mass @ v
    return float(0.5 * (stored + force @ structure.contacts.compliance(0.0) @ force) - load @ x)


@pytest.mark.parametrize("massless", [False, True])
def test_energy_goes_into_the_coating_and_comes_from_borders(massless: bool) -> None:
    """Of modes, residual and casing together; 20 turns of two contacts half a turn apart."""
    entries: dict[str, Any] = {
        "mass": 1e-3 * np.eye(3), "stiffness": 1e5 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 2]]),
        "contact": np.eye(3)[1:], "load": np.array([1.0, 1.0, 1.0]), "angle": np.array([0.0, 3.0]),
    }  # fmt: skip
    if massless:
        entries["residual_flexibility"] = 1e-7 * np.array([[2.0, 1.0], [1.0, 3.0]])
    structure = of_entries(entries).on_casing(1e-6)
    batch = cases(structure, gaps=[2e-5, 3e-5], mean=3.0, velocity=0.1)
    batch = coated(structure, batch, 2.0, 24, hardening=1e5, speed=500.0)
    done = run(structure, batch, sampling(0.04, 0.01))
    assert done.end is not None
    assert batch.coating is not None
    last = [done.histories["displacement"][0, :, -1], done.wear["worn_depth"]]
    sector = np.floor(24 * (batch.coating.turns[0] + 500.0 * 0.04) - 1e-9).astype(int) % 24
    force = np.maximum(0.0, last[0] - batch.gaps[0] - last[1][0][[0, 1], sector]) / 1e-6
    zero, load = np.zeros(2), np.full(3, 3.0)
    before = plain_energy(structure, batch.displacement[0], batch.velocity[0], zero, load)
    after = plain_energy(structure, done.end.displacement[0], done.end.velocity[0], force, load)
    crushed, border = batch.coating.crushing_work(last[1]).sum(), done.metrics["border_work"].sum()
    assert border > 0.05 * crushed > 0
    np.testing.assert_allclose(before - after, crushed - border, rtol=1e-9)


def test_the_map_holds_what_shorter_cases_end_with() -> None:
    _, structure, batch, _ = scene("heat")
    whole = run(structure, batch, replace(sampling(0.1, 0.01), wear_every=2))
    for row, turns in enumerate((2, 4, 6)):
        short = run(structure, batch, sampling(turns / 60.0, 0.5 / 60.0))
        np.testing.assert_allclose(whole.wear["wear_map"][0, row], short.wear["worn_depth"][0], rtol=1e-9)


def test_the_worn_volume_converges_with_the_sectors() -> None:
    """At first order: a sector is as deep as its deepest place."""
    blade = chain(nodes=1, mass=1e-3, stiffness=1e9).on_casing(1e-6)
    batch = cases(blade, gap=-4e-6, casing_harmonics=[[6e-6, 100.0, 0.3]])

    def volume(sectors: int) -> float:
        done = run(blade, coated(blade, batch, 2.0, sectors, hardening=5e5, speed=50.0), sampling(0.021, 0.021))
        return float(done.wear["worn_depth"].mean())

    many = [volume(sectors) for sectors in (45, 90, 180, 360)]
    orders = np.log2(np.abs(np.diff(many[:-1]) / np.diff(many[1:])))
    np.testing.assert_allclose(orders, 1.0, atol=0.15)


def converges(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return differences of `moreau` from the exact motion and worn depth, over the largest, at a step and its half."""
    structure, one = random_case(seed)
    over = sampling(0.006, 5e-5, balances=False)
    exact = run(structure, one, over)
    steps = [stepped(structure, one, h, over, theta=0.5) for h in (2e-6, 1e-6)]
    x, worn = exact.histories["displacement"], exact.wear["worn_depth"]
    moved = [np.abs(each.histories["displacement"] - x).max() / np.abs(x).max() for each in steps]
    crushed = [np.abs(each.wear["worn_depth"] - worn).max() / max(worn.max(), 1e-8) for each in steps]
    return np.array(moved), np.array(crushed)


@pytest.mark.parametrize("seed", [0, 1, 2, 10, 17])
def test_moreau_converges_to_it_at_first_order(seed: int) -> None:
    """Up to five contacts with friction, heat and borders between sectors."""
    moved, worn = converges(seed)
    assert moved[1] < 2e-3
    assert worn[1] < 5e-3
    np.testing.assert_allclose([moved[0] / moved[1], worn[0] / worn[1]], 2.0, rtol=0.2)


@pytest.mark.slow
def test_moreau_converges_to_it_in_random_structures() -> None:
    moved, worn = np.array([converges(seed) for seed in range(40)]).swapaxes(0, 1)
    assert (moved[:, 1] < 5e-3).all()
    assert (worn[:, 1] <= 0.02).all()
    np.testing.assert_allclose(np.median(moved[:, 0] / moved[:, 1]), 2.0, rtol=0.05)
