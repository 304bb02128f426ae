"""Every scheme with a fixed step in studies of several contacts: archives, balances, plans, and what is not solved."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes_of_contacts import OUTPUT, pressed, study, two_masses

from scenes import sampling, step
from workflow import schemes
from workflow.models import Array, Contacts, Structure
from workflow.plan import plan_study
from workflow.run import run_study
from workflow.schemes import RefusedStructureError, Status, penalty

CENTRAL = ("carpenter", "paoli_schatzman", "penalty")
ALL = {
    "schemes": {"spring": {"method": "penalty", "integration": "implicit", "damping": 50.0}},
    "axes": {"scheme": ["moreau", "carpenter", "paoli_schatzman", "penalty", "spring"], "h": 2e-5, "alpha": [0, 5]},
    "output": OUTPUT | {"balances": True, "sections": True},
}


def test_a_study_of_all_schemes_ends_ok_with_its_balances(tmp_path: Path) -> None:
    given = study(tmp_path, **{name: part for name, part in ALL.items() if name != "output"})
    given["output"] = ALL["output"]
    outcome = run_study(given, tmp_path / "all.nc", threads=1)
    assert outcome.counts == {"ok": 10}
    archive = outcome.dataset
    assert archive["energy_residual"].dims == ("scheme", "alpha")
    np.testing.assert_allclose(archive["heat_residual"], 0, atol=1e-12)
    closed = archive["energy_residual"].sel(scheme=["carpenter", "paoli_schatzman"])
    np.testing.assert_allclose(closed, 0, atol=1e-12)
    assert (archive["contact_impulse"] > 0).all()
    assert archive["effective_restitution"].dims == ("scheme", "alpha")
    assert not [warning for warning in plan_study(given).warnings if "fails" in warning]


IMPLICIT = ("penalty", {"integration": "implicit", "stiffness": 1e7})


@pytest.mark.parametrize(
    ("method", "options", "residual"), [("moreau", {}, 0.0), (*IMPLICIT, 0.0), (*IMPLICIT, 1e-9)], ids=str
)
def test_contact_without_a_solution_names_contacts_and_a_step_that_has_one(
    method: str, options: dict[str, Any], residual: float
) -> None:
    """Friction heat pushes two masses into their casings."""
    flexible = {"residual_flexibility": residual * np.eye(2)} if residual else {}
    structure = two_masses(
        coupling=-200 * np.eye(2), heat_capacity=np.eye(2), conductance=0.1 * np.eye(2), thermal_contact=np.eye(2),
        contact_labels=np.array(["mid", "end"]), **flexible,
    )  # fmt: skip
    case = pressed(structure, alpha=np.array([10.0]), velocity=np.ones((1, 2)))
    lost = step(structure, case, 1e-2, sampling(0.1, 1e-2), method, **options)
    assert lost.status.tolist() == [Status.ILL_POSED]
    assert np.isnan(lost.histories["displacement"][0, :, -1]).all()
    assert "contacts mid, end: the symmetric part of its matrix is positive definite up to h = " in lost.messages[0]
    limit = float(lost.messages[0].split("h = ")[-1].split(" s")[0])
    assert 1e-4 < limit < 1e-2
    short = sampling(4 * limit, limit)
    assert step(structure, case, limit, short, method, **options).status.tolist() == [Status.OK]
    assert method != "moreau" or step(structure, case, 1.01 * limit, short).status.tolist() == [Status.ILL_POSED]


@pytest.mark.parametrize("method", ["moreau", "carpenter", "paoli_schatzman"])
def test_friction_that_leaves_no_impulse_is_said(method: str) -> None:
    structure = two_masses(tangent=2 * np.eye(2))
    lost = step(structure, pressed(structure, friction=np.ones(1)), 1e-3, sampling(0.1, 1e-2), method)
    assert lost.status.tolist() == [Status.ILL_POSED]
    assert lost.messages[0].endswith("lower the coefficient of friction, 1")


GROWS: list[tuple[str, dict[str, Any], dict[str, Any], str]] = [
    *((method, {}, {}, "central differences are stable up to 0.02 s") for method in CENTRAL),
    ("moreau", {"theta": 0.3}, {"damping": np.diag([20.0, 40.0])}, "stable up to h = 0.005 s"),  # 20/(0.4 · 1e4)
]


@pytest.mark.parametrize(("method", "options", "entries", "said"), GROWS, ids=[method for method, *_ in GROWS])
def test_a_step_that_grows_freely_is_told_with_the_largest_that_does_not(
    method: str, options: dict[str, Any], entries: dict[str, Any], said: str
) -> None:
    structure = two_masses(**entries)
    ends = [step(structure, pressed(structure), h, sampling(0.4, 2e-2), method, **options) for h in (1e-3, 2.1e-2)]
    assert [int(each.status[0]) for each in ends] == [Status.OK, Status.DIVERGED]
    assert said in ends[1].messages[0]


@pytest.mark.parametrize(
    ("method", "options", "said"),
    [
        *((method, {}, "moreau") for method in CENTRAL),
        ("penalty", {"integration": "implicit", "theta": 0.0}, "`theta` above 0"),  # without a force at the end
    ],
)
def test_contacts_without_mass_are_refused(method: str, options: dict[str, Any], said: str) -> None:
    structure = two_masses(residual_flexibility=1e-6 * np.eye(2))
    with pytest.raises(RefusedStructureError, match=rf"without mass.*{said}"):
        step(structure, pressed(structure), 1e-3, sampling(0.1, 1e-2), method, **options)


def test_schemes_that_do_not_say_so_refuse_contacts_without_mass() -> None:
    structure = two_masses(residual_flexibility=1e-6 * np.eye(2))
    able = schemes.load("moreau")
    several = replace(able, GENERAL=able.GENERAL - {"massless"})
    assert "without mass" in str(several.refusal(structure, able.Options()))
    assert able.refusal(structure, able.Options(theta=0.0)) is None


def alone(structure: Structure, contact: int) -> Structure:
    own = structure.contacts
    rows = {name: getattr(own, name)[[contact]] for name in ("normal", "tangent", "heat", "angle")}
    return replace(structure, contacts=Contacts((own.labels[contact],), **rows))


def test_contact_springs_are_ten_times_as_stiff_as_the_stiffest_contact() -> None:
    structure, options = two_masses(stiffness=np.diag([1e4, 3e4])), penalty.Options()
    each = [penalty.contact_stiffness_of(alone(structure, k), options) for k in range(2)]
    np.testing.assert_allclose(each, [1e5, 3e5], rtol=1e-12)
    assert penalty.contact_stiffness_of(structure, options) == pytest.approx(3e5, rel=1e-12)
    massless = two_masses(residual_flexibility=np.diag([1e-4, 3e-4]))
    assert penalty.contact_stiffness_of(massless, penalty.Options(integration="implicit")) == pytest.approx(5e4)


def test_limits_in_contact_are_those_of_all_contacts_pressed() -> None:
    """Two equal masses that do not know of each other have the limit of one; one mass with two contacts less."""
    explicit = penalty.Options(stiffness=1e6)
    twins = two_masses(mass=np.eye(2))
    limits = [penalty.contact_limit(each, explicit) for each in (twins, alone(twins, 0))]
    assert limits[0] == pytest.approx(limits[1], rel=1e-12)
    row: Array = np.array([[1.0, 0.0], [1.0, 0.0]])
    doubled = penalty.contact_limit(two_masses(mass=np.eye(2), contact=row), explicit)
    assert doubled == pytest.approx(limits[1] / np.sqrt(2), rel=1e-12)
    implicit = penalty.Options(stiffness=1e6, integration="implicit", theta=0.5)
    assert penalty.contact_limit(twins, implicit) == pytest.approx(0.25e-3, rel=1e-12)
    massless = two_masses(residual_flexibility=1e-6 * np.eye(2))
    assert penalty.contact_limit(massless, implicit) == np.inf


def test_options_of_a_rigid_casing_are_those_of_the_lightest_motion_of_contacts() -> None:
    """W of a mass of 1 kg and one of 2 kg is 1 1/kg; both contacts on one mass of 1 kg move twice as much."""
    assert penalty.rigid(two_masses(), 1e-3).damping == pytest.approx(1e3)
    row: Array = np.array([[1.0, 0.0], [1.0, 0.0]])
    assert penalty.rigid(two_masses(contact=row), 1e-3).damping == pytest.approx(500)
