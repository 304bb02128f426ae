"""What plans warn of where a structure has several contacts, or one without mass, and of their bases."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_contacts import DURATION, drawn
from scenes_of_contacts import SCENE, chain, pressed, study, two_masses

from scenes import step
from studies import BLADE_SCENE, parsed
from workflow import run_study
from workflow.judges.cautions import scene_cautions
from workflow.models import Structure, critical_friction, free_reach
from workflow.plan import plan_study
from workflow.reduction import ReducedModel
from workflow.schemes import Sampling
from workflow.study import StudyError, read_study

EXACT = {"scheme": "event_driven"}


def planned(place: Path, entries: dict[str, Any], scene: dict[str, Any] | None = None, **axes: Any) -> list[str]:
    return list(plan_study(study(place, entries, scene=scene or {}, axes={"h": 1e-4, **EXACT, **axes})).warnings)


def told(structure: Structure, **conditions: Any) -> list[str]:
    cases = pressed(structure, **conditions)
    return list(scene_cautions(structure, ReducedModel(structure, None), cases, 1.0, is_static=False))


def test_a_plausible_scene_has_nothing_to_say(tmp_path: Path) -> None:
    assert planned(tmp_path, chain(), alpha=0.1) == []


def test_gaps_that_no_contact_reaches_are_named_with_the_contact_that_comes_closest(tmp_path: Path) -> None:
    entries = {name: value for name, value in chain().items() if name != "damping"}  # it would couple modes
    load = {"load": SCENE["load"] | {"frequency": 80.0}}  # far from a resonance
    (line,) = planned(tmp_path, entries, load, alpha=0, **{"scene.casing.clearance": [0, 5e-3]})
    bound = float(line.split("contact `end` stays below ")[1].split(" µm")[0])
    assert line.startswith("no contact can reach the casing at gap = 0.005055 m: without contact")
    free = study(tmp_path, entries, scene=load | {"casing": {"gap": 1}, "duration": 1.0}, axes=EXACT | {"h": 1e-4})
    with run_study(free, tmp_path / "free.nc", threads=1).dataset as archive:
        reached = 1e6 * archive["displacement"].max(["t"]).values.ravel()
    assert reached[1] > reached[0]
    assert 0.5 * bound < reached[1] < bound


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_no_contact_passes_the_bound_of_its_motion_without_contact(seed: int, massless: bool) -> None:
    case = drawn(seed, massless)
    cases = replace(case.cases, gaps=case.cases.gaps + 1.0)
    structure = replace(case.structure, damper=None)
    free = step(structure, cases, 0.0, Sampling(DURATION, DURATION / 100, 101), "event_driven")
    bound, reached = free_reach(structure, cases, DURATION)[0], free.histories["displacement"][0].max(axis=-1)
    assert np.all(reached.reshape(bound.shape) <= bound)
    assert np.all(bound < 20 * np.abs(free.histories["displacement"]).max())


def test_a_load_in_the_wrong_unit_names_the_contact_that_it_moves_most(tmp_path: Path) -> None:
    lines = planned(tmp_path, chain(), {"load": SCENE["load"] | {"mean": 2.8e4}})
    (line,) = [line for line in lines if "the load alone" in line]
    moved = (2.8e4 + 28) / 2e5 * 5
    assert line.startswith(f"the load alone would move contact `end` by {moved:.3g} m, over a gap of 55 µm")


def test_heat_that_opens_every_gap_is_told_and_heat_that_opens_one_is_not(tmp_path: Path) -> None:
    """A chain whose coupling has the wrong sign; of two opposite stops heat opens one."""
    right = chain()
    wrong = right | {"coupling": -right["coupling"]}
    stops = right | {"contact": np.eye(5)[[-1, -1]] * np.array([[1.0], [-1.0]]), "thermal_contact": np.eye(5)[[-1, -1]]}
    lines = [planned(tmp_path, entries, alpha=0.1) for entries in (right, wrong, stops)]
    assert [sum("away from the casing" in line for line in each) for each in lines] == [0, 1, 0]
    (line,) = [line for line in lines[1] if "away from the casing" in line]
    heat, sides = right["conductance"], right["thermal_contact"]
    warm = np.linalg.solve(heat, sides.T) / np.diag(sides @ np.linalg.solve(heat, sides.T))
    closing = np.diag(sides @ np.linalg.solve(right["stiffness"], right["coupling"] @ warm))
    assert f"every contact away from the casing, {-closing.max():.3g} m for each kelvin at contact `" in line


def test_friction_limits_name_the_contact_or_the_contacts_that_meet_them_first() -> None:
    """Two masses that share no spring: alone at 1/t of each; with a common one both can be worse than each."""
    apart = two_masses(tangent=np.diag([0.5, 0.25]), contact_labels=np.array(["a", "b"]))
    assert told(apart, friction=np.array([1.9])) == []
    lines = told(apart, friction=np.array([2.0]))
    assert [line.split(" (n·")[0] for line in lines] == [
        "contact of `a` has no unique solution at a friction coefficient of 2 or more",
        "permanent contact of `a` has no stable equilibrium at a friction coefficient of 2 or more",
    ]
    crossed = two_masses(tangent=np.array([[0.0, 1.0], [1.0, 0.0]]), contact_labels=np.array(["a", "b"]))
    lines = told(crossed, friction=np.array([1.001]))
    assert [line.split(" or more")[0] for line in lines] == [
        "contact of `a`, `b` has no unique solution at a friction coefficient of 1",
        "permanent contact of `a`, `b` has no stable equilibrium at a friction coefficient of 1",
    ]


@pytest.mark.parametrize("seed", [0, 3, 4, 8])
def test_critical_frictions_are_where_determinants_first_vanish(seed: int) -> None:
    full = drawn(seed).structure
    own = full.contacts
    tangent = own.normal @ np.diag(np.linspace(0.2, 1.4, full.mechanical_size))
    structure = replace(full, contacts=replace(own, tangent=tangent))
    inverses = np.linalg.inv(structure.mass), np.linalg.inv(structure.stiffness_matrix)
    for limit in critical_friction(structure):
        at = [own.labels.index(label) for label in limit.contacts]
        w, t = own.normal[at], tangent[at]
        for inverse, found in zip(inverses, (limit.impact, limit.standstill), strict=True):
            below = np.linspace(0, 1, 2000, endpoint=False) * min(found, 10.0)
            each = w @ inverse @ w.T - below[:, None, None] * (w @ inverse @ t.T)
            assert np.all(np.linalg.det(each) > 0)
            if np.isfinite(found):
                last = w @ inverse @ (w - found * t).T
                assert np.abs(np.linalg.eigvals(last)).min() < 1e-9 * np.abs(each[0]).max()


def test_contacts_without_mass_have_no_impact_law_to_lose() -> None:
    massless = two_masses(tangent=np.diag([0.5, 0.25]), residual_flexibility=1e-4 * np.eye(2))
    (limit,) = told(massless, friction=np.array([5.0]))
    assert "no stable equilibrium" in limit  # 2 (1 + R k): 4 and 8
    assert "at a friction coefficient of 4 or more" in limit


def test_flutter_below_the_static_limit_is_told_and_the_archive_has_runaways(tmp_path: Path) -> None:
    """Light heat capacity: no alpha is critical, and an oscillation grows."""
    entries = chain() | {"heat_capacity": 1e-4 * np.eye(5), "damping": 1e-3 * np.eye(5)}
    entries["coupling"] = -entries["coupling"]
    given = study(tmp_path, entries, axes={"h": 1e-4, **EXACT, "alpha": [0, 50]})
    lines = [line for line in plan_study(given).warnings if "flutter" in line]
    with run_study(given, tmp_path / "a.nc", threads=1).dataset as archive:
        assert np.isinf(archive["critical_alpha"]).all()
        assert archive["runaway"].values.ravel().tolist() == [0, 1]
        rate = float(archive["growth_rate"].sel(alpha=50))
    assert len(lines) == 1
    assert lines[0].startswith("at alpha = 50 W/N permanent contact flutters, although alpha is below")
    assert f"grows at {rate:.3g} 1/s" in lines[0]


def test_a_depth_that_a_basis_cannot_record_is_told_before_it_fails(tmp_path: Path) -> None:
    axes = "axes: {scheme: event_driven, reduction: [craig_bampton, macneal], mechanical_modes: 3, thermal_modes: 12}\n"
    text = f"study: a{BLADE_SCENE}{axes}output: {{histories: [], temperature_depth: 2 mm}}\n"
    lines = [line for line in plan_study(parsed(text)).warnings if "fails" in line]
    assert len(lines) == 1
    assert "fails with macneal, as it does not record the temperature over a depth at contacts without mass" in lines[0]
    with pytest.raises(StudyError, match="temperature_depth: takes a rigid casing"):
        parsed(text.replace("{gap: 20 um}", "{gap: 20 um, flexibility: 1e-8}"))


FRICTION = {"coefficient": 0.1, "sliding_speed": 100.0, "heat_share": 0.01}


def planned_rub(place: Path, axes: dict[str, Any], **more: Any) -> tuple[str, ...]:
    entries = chain(40)
    entries["conductance"] = 400 * entries["conductance"]  # heat enters about a node in a contact
    exact = {"scheme": "event_driven", "h": 1e-4, "mechanical_modes": 6, **axes}
    return plan_study(study(place, entries, scene={"friction": FRICTION}, axes=exact, **more)).warnings


@pytest.mark.parametrize("basis", ["craig_bampton", "rubin"])
@pytest.mark.parametrize(("modes", "contacts"), [(8, "contact `mid`, contact `end`"), (36, "")])
def test_thermal_modes_that_are_too_few_are_told_of_each_contact(
    tmp_path: Path, basis: str, modes: int, contacts: str
) -> None:
    lines = planned_rub(tmp_path, {"reduction": basis, "thermal_modes": modes})
    found = [line for line in lines if "times the depth" in line]
    assert [line.split(" at ")[1].split(": ")[0] for line in found] == ([contacts] if contacts else [])
    assert all(line.endswith("keep more, or use krylov") for line in found)


def test_krylov_resolves_the_depth_with_as_few(tmp_path: Path) -> None:
    assert not [line for line in planned_rub(tmp_path, {"reduction": "krylov", "thermal_modes": 8}) if "depth" in line]


def test_auto_takes_krylov_where_no_basis_is_named(tmp_path: Path) -> None:
    auto = {"mechanical_modes": "auto", "tolerance": 1e-3}

    def basis(**more: Any) -> tuple[str, Any]:
        read = read_study(study(tmp_path, **more))
        (own,) = (axis.values for axis in read.axes() if axis.path == "reduction")
        return own[0], None if read.reference is None else read.reference.values.get("reduction")

    assert basis(axes=auto) == ("krylov", None)
    assert basis(axes=auto | {"reduction": "rubin"}) == ("rubin", None)
    assert basis(axes={"mechanical_modes": 2}, reference=auto) == ("craig_bampton", "krylov")
    assert basis(axes={"reduction": "rubin"}, reference=auto) == ("rubin", None)


@pytest.mark.parametrize(("counts", "told"), [({"mechanical_modes": 20}, True), ({"mechanical_modes": "full"}, False)])
def test_a_reference_with_fixed_counts_is_told(tmp_path: Path, counts: dict[str, Any], told: bool) -> None:
    reference = {"scheme": "event_driven", "thermal_modes": "full", **counts}
    lines = planned_rub(tmp_path, {"reduction": "krylov", "thermal_modes": 8}, reference=reference)
    found = [
        line
        for line in lines
        if line.startswith("nothing states the error of the reference's basis, 20 mechanical + 39 thermal ")
    ]
    assert len(found) == told
