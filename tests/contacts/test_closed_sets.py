"""Growth and critical couplings of closed sets of contacts, against eigenvalues in the coordinates of the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_contacts import drawn
from scenes_of_contacts import chain, study

from scenes import of_entries, poles_in_contact
from workflow import labels, run_study
from workflow.analysis import runaways
from workflow.models import (
    analyse_contacts,
    closed_sets,
    critical_alpha,
    critical_alphas,
    growth_of_sets,
    growth_rate,
    set_text,
    structure_from_matrices,
    structure_from_sparse,
)
from workflow.models.modes import Parameters, assemble
from workflow.plan import plan_study
from workflow.reduction import reduce_structure
from workflow.report import write_report
from workflow.run import Outcome

EXACT = {"scheme": "event_driven", "e": 0.0, "h": 1e-4}


def plate() -> dict[str, Any]:
    """Two corners of a plate, K1⁻¹ = [[1, 1/2], [1/2, 1]] µm/N; heat at the first lengthens both alike."""
    stiffness = 1e6 / 0.75 * np.array([[1.0, -0.5], [-0.5, 1.0]])
    lengthens = np.array([[2e-7, 0.0], [2e-7, 2e-8]])  # m/K, of a corner by a temperature
    return {
        "mass": 0.02 * np.eye(2),
        "stiffness": stiffness,
        "damping": 4e-5 * stiffness + 0.8 * np.eye(2),
        "contact": np.eye(2),
        "contact_labels": np.array(["leading edge", "trailing edge"]),
        "thermal_contact": np.eye(2),
        "heat_capacity": 0.05 * np.eye(2),
        "conductance": np.diag([0.1, 1.0]),
        "coupling": -stiffness @ lengthens,
        "load": np.array([1.0, 0.0]),
    }


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", [0, 2, 3, 4, 8])
def test_growth_of_random_sets_is_that_of_their_matrices(seed: int, massless: bool) -> None:
    structure = drawn(seed, massless).structure
    alpha, friction = np.array([0.0, 5.0, 300.0]), np.array([0.3, 0.0, 0.2])
    found, sets = growth_of_sets(analyse_contacts(structure), alpha, friction), closed_sets(structure.contacts)
    assert len(sets) == structure.contacts.count + (structure.contacts.count > 1)
    for name, closed in sets.items():
        for k in range(alpha.size):
            values = poles_in_contact(structure, closed, alpha[k], friction[k])
            worst = values[np.argmax(values.real)]
            near = {"rel": 1e-8, "abs": 1e-11 * np.abs(values).max()}
            assert found[name].rate[k] == pytest.approx(worst.real, **near)
            assert found[name].frequency[k] == pytest.approx(abs(worst.imag) / 2 / np.pi, **near)
    rates = [max(one.rate[k] for one in found.values()) for k in range(alpha.size)]
    assert [growth_rate(structure, *each) for each in zip(alpha, friction, strict=True)] == pytest.approx(rates)


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_a_set_has_a_real_pole_at_zero_at_its_critical_coupling(seed: int, massless: bool) -> None:
    structure, friction = drawn(seed, massless).structure, 0.15
    limits = critical_alphas(structure, friction)
    for name, closed in closed_sets(structure.contacts).items():
        if 0 < limits[name] < np.inf:
            at, before = (poles_in_contact(structure, closed, share * limits[name], friction) for share in (1.0, 0.9))
            assert np.abs(at).min() < 1e-9 * np.abs(at).max() < 1e-3 * np.abs(before).min() * 1e9
    assert critical_alpha(structure, friction) == min(limits.values())


def test_a_body_that_one_contact_does_not_hold_runs_away_by_none_alone() -> None:
    """A free pair of masses with two contacts: λ alone accelerates it; both squeeze no spring of a third."""
    free = {"mass": np.eye(3), "stiffness": 1e4 * np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]])}
    heat = {"heat_capacity": np.eye(3), "conductance": np.eye(3), "thermal_contact": np.eye(3)[[0, 2]]}
    pulls = -free["stiffness"] @ np.diag([-1e-3, 0.0, 1e-3])
    ends = {"contact": np.array([[-1.0, 0, 0], [0, 0, 1.0]]), "contact_labels": np.array(["a", "b"])}
    structure = of_entries(free | heat | ends | {"coupling": pulls})
    limits = critical_alphas(structure)
    assert [limits["a",], limits["b",]] == [np.inf, np.inf]
    both = np.array([1e-4, 1e-4])  # the springs of 1e4 N/m in line, squeezed from both ends by one force
    assert limits["a", "b"] == pytest.approx(both.sum() / 2e-3, rel=1e-9)
    at = np.abs(poles_in_contact(structure, [0, 1], limits["a", "b"], 0.0))
    assert at.min() < 1e-12 * at.max()


def test_friction_alone_that_leaves_no_stable_rest_has_no_critical_coupling() -> None:
    """S = w K1⁻¹ (w - µ t) < 0 of the first contact, of one and of two."""
    entries = plate() | {"tangent": np.array([[0.0, 4.0], [0.0, 0.0]])}
    assert critical_alphas(of_entries(entries), 0.6)["leading edge",] == 0.0
    assert critical_alphas(of_entries(entries), 0.4)["leading edge",] == pytest.approx(0.1)
    one = {
        name: rows[:1] if name in ("contact", "thermal_contact", "tangent") else rows for name, rows in entries.items()
    }
    assert critical_alpha(of_entries(one | {"contact_labels": np.array(["leading edge"])}), 0.6) == 0.0


@pytest.mark.parametrize(("sign", "limits"), [(1, [0.0, 0.0, 0.0]), (-1, [np.inf, np.inf, np.inf])])
def test_heat_that_cannot_leave_counts_where_it_pushes_out(sign: int, limits: list[float]) -> None:
    entries = plate() | {"conductance": np.array([[1.0, -1.0], [-1.0, 1.0]])}
    entries["coupling"] = sign * -entries["stiffness"] @ np.full((2, 2), 1e-7)
    assert list(critical_alphas(of_entries(entries)).values()) == limits


@pytest.mark.parametrize("heat", ["leaves", "stays", "none"])
@pytest.mark.parametrize("massless", [False, True])
def test_sparse_matrices_have_the_critical_couplings_of_dense_ones(
    heat: str, massless: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By static answers: a structure of more coordinates has no dense matrices, and all its modes are never found."""
    monkeypatch.setattr("workflow.models._sparse_pair.MOST_FULL", 20)
    entries = chain(40, heated=heat != "none") | {"tangent": np.eye(40)[[20, 30]]}
    if heat == "stays":
        springs = np.diff(np.eye(40), axis=0)
        entries["conductance"] = 0.5 * springs.T @ springs
    if massless:
        entries |= {"residual_flexibility": 1e-6 * np.eye(2), "residual_tangent": np.diag([4e-7, 0.0])}
        entries |= {"residual_coupling": 1e-9 * np.ones((2, 40))} if heat != "none" else {}
    dense, sparse = (of_entries(entries, build=build) for build in (structure_from_matrices, structure_from_sparse))
    assert sparse.is_sparse
    for friction in (0.0, 0.2, 3.0):
        expected = critical_alphas(dense, friction)
        assert critical_alphas(sparse, friction) == pytest.approx(expected, rel=1e-8), friction


def bend(**more: Any) -> dict[str, Any]:
    """Three masses with dampers, the second of which a contact holds or not."""
    stiffness = 1e5 * np.array([[2.0, -1, 0], [-1, 2, -1], [0, -1, 1]])
    return {"mass": np.diag([1.0, 2.0, 1.0]), "stiffness": stiffness, "damping": 1e-3 * stiffness, **more}


def rate_of(entries: dict[str, Any], held: list[int]) -> float:
    """Growth rate of the masses that are not held."""
    rest = np.setdiff1d(np.arange(3), held)
    k, c, m = (entries[name][np.ix_(rest, rest)] for name in ("stiffness", "damping", "mass"))
    n, still = len(rest), -np.linalg.inv(m)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [still @ k, still @ c]])
    return float(np.linalg.eigvals(A).real.max())


def test_the_temperature_that_stands_for_none_does_not_count() -> None:
    """One contact, two, without mass, reduced, and a table of modes: none has the pole 0."""
    one, two = bend(contact=np.eye(3)[[2]]), bend(contact=np.eye(3)[[1, 2]])
    assert rate_of(one, [2]) < -20
    assert growth_rate(of_entries(one), 0.0) == pytest.approx(rate_of(one, [2]), rel=1e-9)
    assert growth_rate(of_entries(one), 3.0) == growth_rate(of_entries(one), 0.0)
    worst = max(rate_of(two, held) for held in ([1], [2], [1, 2]))
    assert growth_rate(of_entries(two), 0.0) == pytest.approx(worst, rel=1e-9)
    assert growth_rate(of_entries(two), 3.0) == pytest.approx(worst, rel=1e-9)
    for basis in ("craig_bampton", "krylov", "macneal"):
        assert growth_rate(reduce_structure(of_entries(two), 1, 0, basis, 0.1).structure, 3.0) < -5
    squares, shapes = np.linalg.eigh(np.diag([1, 0.5**0.5, 1]) @ bend()["stiffness"] @ np.diag([1, 0.5**0.5, 1]))
    table = np.column_stack([np.sqrt(squares) / 2 / np.pi, 5e-4 * np.sqrt(squares), shapes[2]])
    modal = assemble(Parameters(table=tuple(map(tuple, table.tolist()))))
    assert growth_rate(modal, 3.0) == pytest.approx(rate_of(one, [2]), rel=1e-8)


def test_what_contact_holds_whole_neither_grows_nor_decays() -> None:
    masses = {"mass": np.eye(2), "stiffness": 1e4 * np.eye(2), "damping": 3.0 * np.eye(2)}
    both = of_entries(masses | {"contact": np.eye(2), "contact_labels": np.array(["a", "b"])})
    assert growth_rate(both, 1.0) == pytest.approx(-1.5)  # the other mass, while one is held
    alone = of_entries({"mass": np.eye(1), "stiffness": 1e4 * np.eye(1), "contact": np.eye(1)})
    assert growth_rate(alone, 1.0) == 0.0


@pytest.fixture(scope="module")
def corner(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    """The corner that rubs runs away above 0.5 W/N, both together above 0.75; the second has 20 mm of room."""
    place = tmp_path_factory.mktemp("corner")
    scene = {"casing": {"gap": [2e-5, 0.02002]}, "speed": 0.0, "duration": 0.1}
    scene["load"] = {"mean": 30.0, "amplitude": 6.0, "frequency": 20.0}
    axes = EXACT | {"alpha": [0.4, 0.6, 0.9]}
    return run_study(study(place, plate(), scene=scene, axes=axes), place / "a.nc", threads=1)


def test_the_worst_set_is_named(corner: Outcome) -> None:
    with corner.dataset as archive:
        archive = archive.load()
    at = {name: archive[name].squeeze() for name in ("critical_alpha", "critical_set", "growth_rate", "growth_set")}
    assert at["critical_alpha"].values == pytest.approx(0.5, rel=1e-12)
    assert at["critical_set"].values.tolist() == ["leading edge alone"] * 3
    assert at["growth_set"].values.tolist() == ["leading edge alone"] * 3
    structure = of_entries(plate())
    rates = [poles_in_contact(structure, [0], alpha, 0.0).real.max() for alpha in (0.4, 0.6, 0.9)]
    assert at["growth_rate"].values == pytest.approx(rates, rel=1e-9)
    assert labels(archive["runaway"]).values.ravel().tolist() == ["bounded", "runaway", "runaway"]
    assert runaways(archive) == (2, 0, "leading edge alone: 0.5", "")


def test_plan_show_and_page_name_the_worst_set(corner: Outcome, tmp_path: Path) -> None:
    from workflow.cli._archives import _statuses
    from workflow.cli._studies import _structure

    scene = {"casing": {"gap": [2e-5, 0.02002]}, "speed": 0.0}
    (figures,) = plan_study(study(tmp_path, plate(), scene=scene, axes=EXACT | {"alpha": 0.6})).structures
    assert _structure(figures).endswith("critical alpha of leading edge alone: 0.5 W/N; alpha is 1.2 times that")
    page = write_report(corner.archive, tmp_path / "a.html").page.read_text(encoding="utf-8")
    assert "2 of the ok cases lie above the critical heat coupling (leading edge alone: 0.5 W/N)" in page
    with corner.dataset as archive:
        assert "2 ok cases above their critical alpha (leading edge alone: 0.5 W/N)" in "".join(_statuses(archive))


def coupled(**more: Any) -> dict[str, Any]:
    """Two masses beside a contact that friction drives against each other, and a second contact of its own."""
    stiffness = 1e4 * np.array(
        [[2.0, 0.4, 0.5, 0.0], [0.4, 1.0, 0.0, 0.0], [0.5, 0.0, 1.05, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )
    tangent = np.array([[0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 0.0, 0.0]])
    rows = {"contact": np.eye(4)[[0, 3]], "tangent": tangent, "contact_labels": np.array(["a", "b"])}
    return {"mass": np.eye(4), "stiffness": stiffness, "damping": 0.1 * np.eye(4), "load": np.eye(4)[0], **rows, **more}


@pytest.mark.parametrize("contacts", [1, 2])
def test_friction_alone_makes_a_runaway_that_plan_calls_flutter(contacts: int, tmp_path: Path) -> None:
    entries = coupled()
    for name in ("contact", "tangent", "contact_labels"):
        entries[name] = entries[name][:contacts]
    gap, friction = [1e-3] * contacts, {"coefficient": 0.3, "sliding_speed": 1.0, "heat_share": 0.0}
    scene = {"casing": {"gap": gap}, "speed": 0.0, "duration": 0.02, "friction": friction}
    scene["load"] = {"mean": 1.0}
    given = study(tmp_path, entries, scene=scene, axes=EXACT)
    values = poles_in_contact(of_entries(entries), [0], 0.0, 0.3)
    worst = values[np.argmax(values.real)]
    assert worst.real > 1
    (line,) = [line for line in plan_study(given).warnings if "flutter" in line]
    closed = "with a alone closed " if contacts == 2 else ""
    assert f"{closed}an oscillation of {abs(worst.imag) / 2 / np.pi:.4g} Hz grows at {worst.real:.3g} 1/s" in line
    with run_study(given, tmp_path / "a.nc", threads=1).dataset as archive:
        assert archive["runaway"].values.ravel().tolist() == [1]
        assert archive["growth_rate"].values.ravel() == pytest.approx([worst.real], rel=1e-9)
        assert ("growth_set" in archive) == ("critical_set" in archive) == (contacts == 2)
        assert runaways(archive) == (0, 1, "", "a alone" if contacts == 2 else "")


def test_sets_in_words() -> None:
    assert [set_text(each) for each in ((), ("LE",), ("LE", "TE"))] == ["", "LE alone", "LE, TE together"]
