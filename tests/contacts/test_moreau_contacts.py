"""moreau with several contacts: plain matrices, one contact, convergence to exact scenes, rest, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import plain_contacts
import pytest
from plain_contacts import Operator
from random_contacts import Drawn, drawn
from ruamel.yaml import YAML
from scenes_of_contacts import plate, study
from two_masses import pressed, two_masses

import workflow
from scenes import WAVES, alone, everything_acts, heavy_chain, same_bits, sampling, step
from workflow.models import Array, Cases, Contacts, Harmonics, Structure, at_rest
from workflow.schemes import HISTORIES, Status

SCENES = Path(__file__).parent / "scenes"
H, OVER = 4e-5, sampling(0.004, 5e-5)
METRICS = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing")


def apart(ours: Array, truth: Array) -> float:
    """Return the largest difference over the largest value."""
    return float(np.abs(ours - truth).max() / max(np.abs(truth).max(), 1e-9))


def varied(seed: int, massless: bool) -> Drawn:
    """Return a random structure, every third with damping that couples modes, and expansion of what has no mass."""
    case, rng = drawn(seed, massless), np.random.default_rng(seed)
    structure, contacts = case.structure, case.structure.contacts
    assert contacts is not None
    if massless and case.cases.alpha[0] > 0:
        expands = 1e-6 * rng.uniform(-1, 1, contacts.heat.shape)
        structure = replace(structure, contacts=replace(contacts, residual_coupling=expands))
    if seed % 3 == 0:
        along = rng.normal(size=structure.mechanical_size)
        structure = replace(structure, damper=20 * np.outer(along, along))
    return Drawn(structure, case.cases)


@pytest.mark.parametrize("massless", [False, True])
def test_thirty_random_structures_are_stepped_as_in_plain_matrices(massless: bool) -> None:
    touched = 0.0
    for seed in range(30):
        case, theta = varied(seed, massless), (0.5, 0.7, 1.0)[seed // 3 % 3]
        ours = step(case.structure, case.cases, H, OVER, theta=theta)
        truth = plain_contacts.compute(Operator(case.structure, H, theta), case.cases, OVER)
        assert ours.status.tolist() == [Status.OK], ours.messages
        for name in HISTORIES:
            assert apart(ours.histories[name], truth.histories[name]) < 1e-9, (seed, name)
        for name in METRICS:
            assert apart(ours.metrics[name], truth.metrics[name]) < 1e-9, (seed, name)
        touched += float((np.atleast_2d(ours.metrics["contact_time"]) > 0).mean()) / 30
    assert touched > 0.4


@pytest.mark.parametrize(("theta", "moving"), [(0.5, {}), (0.5, WAVES), (1.0, WAVES)])
def test_one_contact_as_a_row_is_the_tip(theta: float, moving: Any) -> None:
    """With every load, in a duration that is no multiple of the step."""
    structure, over = heavy_chain(nodes=6).matrices(), sampling(0.0303, 3e-4)
    tip = np.eye(6)[-1:]
    rows = replace(structure, contacts=Contacts(("1",), tip, 0 * tip, tip, np.zeros(1)))
    batch = everything_acts(structure, 3, gap=1.5e-5, alpha=[0.0, 20.0, 50.0], e=[0.0, 0.3, 0.8], **moving)
    ours, one = (step(each, batch, 1.7e-5, over, theta=theta) for each in (rows, structure))
    assert one.metrics["impacts"].min() > 3
    for name in ("period_impulse", "period_temperature", "period_contact"):
        np.testing.assert_allclose(getattr(ours, name), getattr(one, name), rtol=1e-8, atol=1e-12)
    for arrays, truth in ((ours.histories, one.histories), (ours.metrics, one.metrics), (ours.sections, one.sections)):
        assert arrays.keys() == truth.keys()
        for name, values in truth.items():
            assert apart(arrays[name], values) < 1e-10, name


@pytest.mark.parametrize("name", ["chain_two_heat_e0", "plate_three", "two_stops_e6"])
def test_steps_converge_to_exact_scenes(name: str, tmp_path: Path) -> None:
    """At θ = 1/2, at first order: a sixteenth of the step leaves less than an eighth of the error."""
    exact, given = np.load(SCENES / f"{name}_exact.npz"), YAML(typ="safe").load(SCENES / f"{name}.yaml")
    given["scene"]["matrices"]["file"] = str(SCENES / given["scene"]["matrices"]["file"])
    coarse = given["output"]["interval"] / 4
    given["schemes"] = {"midpoint": {"method": "moreau", "theta": 0.5}}
    given["axes"] |= {"scheme": ["midpoint"], "h": [coarse, coarse / 16]}
    archive = workflow.run_study(workflow.read_study(given), tmp_path / "steps.nc", threads=1).dataset
    for variable in ("displacement", "impulse"):
        truth = exact[variable]
        steps = archive[variable].squeeze().transpose("h", "contact", "t").values
        errors = [float(np.linalg.norm(values - truth) / np.linalg.norm(truth)) for values in steps]
        assert errors[1] < errors[0] / 8, (variable, errors)
        assert errors[1] < 0.02, (variable, errors)
    archive.close()


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0, 0.3])
def test_the_error_on_a_plate_with_five_contacts_is_of_first_order(e: float, tmp_path: Path) -> None:
    """θ = 1/2 on a Craig–Bampton basis with mass, friction, heat and a casing that moves."""
    casing = {
        "gap": [2e-5, 2.2e-5, 2.4e-5, 2.6e-5, 2.8e-5],
        "harmonics": [{"order": 2, "amplitude": 1e-5, "phase": 0.5}],
    }
    scene = {
        "casing": casing,
        "speed": 60.0,
        "load": {"amplitude": 40.0, "frequency": 150.0, "phase": 0.2},
        "friction": {"coefficient": 0.2, "sliding_speed": 50.0, "heat_share": 0.5},
    }
    steps = 2e-5 / 2.0 ** np.arange(6)
    axes = {"scheme": ["exact", "midpoint"], "h": steps.tolist(), "e": e, "reduction": "craig_bampton"}
    axes |= {"mechanical_modes": 4, "thermal_modes": 4}
    two = {"exact": {"method": "event_driven"}, "midpoint": {"method": "moreau", "theta": 0.5}}
    archive = workflow.run_study(
        study(tmp_path, plate(), scene=scene, schemes=two, axes=axes), tmp_path / "a.nc"
    ).dataset
    exact, stepped = archive.sel(scheme="exact").isel(h=0).squeeze(), archive.sel(scheme="midpoint")
    assert exact["impacts"].min() > 5
    assert exact["max_temperature"].min() > 1
    for variable, most in (("displacement", 1.5e-3), ("impulse", 1e-3), ("temperature", 1e-3)):
        truth = exact[variable].values
        values = stepped[variable].squeeze().transpose("h", "contact", "t").values
        errors = [float(np.linalg.norm(each - truth) / np.linalg.norm(truth)) for each in values]
        slope = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
        assert 0.85 < slope < 1.25, (variable, errors)
        assert errors[-1] < most, (variable, errors)
    archive.close()


def many(massless: bool) -> tuple[Structure, Cases]:
    """Return a structure and cases that differ in all that a batch may vary; one is cold."""
    case = varied(0, massless)
    own, count = case.cases, 5
    rows = {name: getattr(own, name) for name in own.__dataclass_fields__}
    several = {name: np.repeat(value, count, axis=0) for name, value in rows.items() if isinstance(value, np.ndarray)}
    waves = {name: value.spread(count) for name, value in rows.items() if isinstance(value, Harmonics)}
    batch, grows = Cases(**several, **waves), np.linspace(0, 1, count)
    return case.structure, replace(
        batch, e=0.9 * grows, alpha=30 * grows, friction=0.2 * grows, gaps=batch.gaps + 1e-5 * grows[:, None]
    )


@pytest.mark.parametrize("massless", [False, True])
def test_a_case_alone_has_the_bits_it_has_in_a_batch(massless: bool) -> None:
    structure, batch = many(massless)
    together = step(structure, batch, H, OVER, theta=0.5)
    for k in range(batch.count):
        one = step(structure, alone(batch, k), H, OVER, theta=0.5)
        row = {name: getattr(together, name)[k : k + 1] for name in ("status", *PERIODS)}
        histories, metrics = (
            {n: a[k : k + 1] for n, a in each.items()} for each in (together.histories, together.metrics)
        )
        assert same_bits(one, replace(together, histories=histories, metrics=metrics, **row))


PERIODS = ("period_impulse", "period_temperature", "period_contact")


@pytest.mark.parametrize("massless", [False, True])
def test_what_starts_pressed_in_equilibrium_stays_on_its_casing(massless: bool) -> None:
    """In motion too: x = d, and with a casing at rest λ = f - k d."""
    residual = {"residual_flexibility": 1e-6 * np.eye(2)} if massless else {}
    structure = two_masses(**residual)
    for amplitude in (0.0, 1e-5):
        turns = np.array([[[0.0], [0.7]]])
        wave = Harmonics(*np.array([[[amplitude]], [[3.0]], [[0.2]]]))
        case = at_rest(structure, pressed(structure, casing_harmonics=wave, turns=turns))
        over = sampling(0.1, 1e-3)
        ours = step(structure, case, 1e-3, over, theta=0.5)
        place = np.stack([case.casing_of_contacts(t)[0] for t in over.times], axis=-1)
        np.testing.assert_allclose(ours.histories["displacement"], place, rtol=4e-15)
        assert ours.metrics["contact_time"][0] == pytest.approx([0.1, 0.1])
        if amplitude == 0:
            force = (np.array([30.0, 50.0]) - 1e4 * 1e-3) / (1 + 1e4 * 1e-6 * massless)
            np.testing.assert_allclose(ours.histories["impulse"][0], force[:, None] * over.times, rtol=1e-9, atol=1e-15)


def test_contact_without_a_solution_names_contacts_and_a_step_that_has_one() -> None:
    heated = {
        "coupling": -200 * np.eye(2), "heat_capacity": np.eye(2), "conductance": 0.1 * np.eye(2),
        "thermal_contact": np.eye(2), "contact_labels": np.array(["mid", "end"]),
    }  # fmt: skip
    structure = two_masses(**heated)
    case = pressed(structure, alpha=np.array([10.0]), velocity=np.ones((1, 2)))
    lost = step(structure, case, 1e-2, sampling(0.1, 1e-2))
    assert lost.status.tolist() == [Status.ILL_POSED]
    assert np.isnan(lost.histories["displacement"][0, :, -1]).all()
    assert "contacts mid, end: the symmetric part of its matrix is positive definite up to h = " in lost.messages[0]
    limit = float(lost.messages[0].split("h = ")[-1].split(" s")[0])
    assert 1e-4 < limit < 1e-2
    short = sampling(4 * limit, limit)
    assert step(structure, case, limit, short).status.tolist() == [Status.OK]
    assert step(structure, case, 1.01 * limit, short).status.tolist() == [Status.ILL_POSED]


def test_friction_that_leaves_no_impulse_is_said() -> None:
    structure = two_masses(tangent=2 * np.eye(2))
    lost = step(structure, pressed(structure, friction=np.ones(1)), 1e-3, sampling(0.1, 1e-2))
    assert lost.status.tolist() == [Status.ILL_POSED]
    assert lost.messages[0].endswith("lower the coefficient of friction, 1")


def test_a_step_that_grows_freely_is_told_with_the_largest_that_does_not() -> None:
    structure = two_masses(damping=np.diag([20.0, 40.0]))
    results = [step(structure, pressed(structure), h, sampling(0.1, 1e-3), theta=0.3) for h in (1e-3, 2e-2)]
    assert [int(each.status[0]) for each in results] == [Status.OK, Status.DIVERGED]
    assert "stable up to h = 0.005 s" in results[1].messages[0]  # 20/(0.4 · 1e4)
