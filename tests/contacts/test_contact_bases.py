"""Bases of several contacts, and bases that leave contacts without mass."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from random_contacts import DURATION, drawn
from scenes_of_contacts import chain, study

import scenes
from matrix_files import matrices_of
from scenes import of_entries
from sliding import random_structure
from workflow import models, schemes
from workflow.analysis import decided
from workflow.models import Array, Cases, Rayleigh, Structure, at_rest, critical_alpha
from workflow.models._from_matrices import _sparse_structure
from workflow.models.matrices import write_matrices
from workflow.plan import plan_study
from workflow.reduction import Reduction, projection_residual, reduce_structure
from workflow.run import run_study
from workflow.schemes import Results, Sampling

BASES = ("craig_bampton", "krylov", "macneal", "massless", "rubin", "weakly_coupled")
WITHOUT_MASS = ("macneal", "massless")


def run(structure: Structure, cases: Cases, duration: float = DURATION) -> Results:
    return scenes.step(structure, cases, 0.0, Sampling(duration, duration / 100, 101), "event_driven")


def apart(these: Results, those: Results) -> float:
    """Return the largest difference of any history, over its largest value."""
    pairs = [(these.histories[name], those.histories[name]) for name in ("displacement", "temperature", "impulse")]
    return max(float(np.abs(a - b).max() / (np.abs(b).max() or 1.0)) for a, b in pairs)


def reduced_run(reduction: Reduction, cases: Cases, duration: float = DURATION) -> Results:
    return run(reduction.structure, reduction.project(cases), duration)


def static(structure: Structure, friction: float) -> Array:
    """Return S_ij = w_i K1⁻¹ (w_j - µ t_j) + R_ij - µ R^t_ij, m/N."""
    contacts = structure.contacts
    across = (contacts.normal - friction * contacts.tangent).T
    answer = np.zeros((contacts.count, contacts.count))
    if structure.mechanical_size:
        answer = contacts.normal @ np.linalg.solve(structure.stiffness_matrix, across)
    return np.asarray(answer + (contacts.flexibility(friction) if contacts.is_massless else 0.0))


@pytest.mark.parametrize("seed", [0, 3, 4, 6, 7, 11])
def test_all_modes_lose_nothing(seed: int) -> None:
    """Two to five contacts with friction, heat, a moving casing and temperatures that contacts share."""
    case = drawn(seed)
    contacts = case.structure.contacts
    heats = case.structure.thermal_size - np.linalg.matrix_rank(contacts.heat)
    reduction = reduce_structure(case.structure, case.structure.mechanical_size - contacts.count, int(heats))
    assert apart(reduced_run(reduction, case.cases), run(case.structure, case.cases)) < 1e-9


@pytest.mark.parametrize("basis", BASES)
@pytest.mark.parametrize("count", [0, 1, 3])
@pytest.mark.parametrize("seed", [3, 4, 10, None])
def test_static_answers_and_critical_coupling_are_exact(basis: str, count: int, seed: int | None) -> None:
    """Of several contacts, and of one that is the tip."""
    tip = random_structure(np.random.default_rng(4), 8, 3)
    full, thermal = (tip, None) if seed is None else (drawn(seed).structure, 0)
    count = min(count, full.mechanical_size - full.contacts.count)
    small = reduce_structure(full, count, thermal, basis, DURATION).structure
    assert small.contacts.is_massless == (basis in WITHOUT_MASS)
    if seed is None:  # the tip's own vector, and that of friction
        assert small.mechanical_size == count + (0 if basis in WITHOUT_MASS else 2)
    for friction in (0.0, 0.3, -0.8):
        assert static(small, friction) == pytest.approx(static(full, friction), rel=1e-9)
        assert critical_alpha(small, friction) == pytest.approx(critical_alpha(full, friction), rel=1e-9)
    if small.contacts.is_massless and count > 1:  # MacNeal's residual is added to what there is
        twice = reduce_structure(small, 1, 0, "macneal").structure
        assert static(twice, 0.3) == pytest.approx(static(full, 0.3), rel=1e-9)
        assert critical_alpha(twice, 0.3) == pytest.approx(critical_alpha(full, 0.3), rel=1e-9)


def clamped(nodes: int) -> dict[str, Any]:
    """Return a clamped rod of 1 kg with contacts in the middle and at the end, rubbed in front of both."""
    links = np.eye(nodes) - np.eye(nodes, k=-1)
    stiffness = 2e7 * nodes * links.T @ links
    return {
        "mass": np.eye(nodes) / nodes,
        "stiffness": stiffness,
        "damping": 20 * np.eye(nodes) / nodes + 1e-6 * stiffness,
        "contact": np.eye(nodes)[[nodes // 2, nodes - 1]],
        "tangent": 0.5 * np.eye(nodes)[[nodes // 3, nodes // 4]],
        "load": np.eye(nodes)[-1],
    }


def rub(structure: Structure, **values: Any) -> Cases:
    """Return a load on the end that presses both contacts of a rod, in the coordinates of its file."""
    load = {"friction": 0.1, "amplitude": 20.0, "frequency": 300.0, "phase": 0.2}
    gaps = [2e-7, 4e-7][: structure.contacts.count]
    return scenes.cases_of_file(structure, **{"gaps": gaps, **load, **values})


def test_more_modes_come_closer() -> None:
    """Displacements by Craig–Bampton as 1/count³, by MacNeal's modes as 1/count²."""
    full = of_entries(clamped(60))
    cases = rub(full)
    whole = run(full, cases, 0.01)
    assert whole.metrics["impacts"].min() > 5
    for basis, errors in {"craig_bampton": (0.02, 2e-3, 2e-4), "macneal": (0.2, 0.04, 0.02)}.items():
        for count, most in zip((5, 10, 20), errors, strict=True):
            assert apart(reduced_run(reduce_structure(full, count, None, basis), cases, 0.01), whole) < most


def test_massless_with_all_modes_is_the_structure_whose_contacts_have_no_mass() -> None:
    """x_c = -K_cc⁻¹ (K_ci x_i + λ): its interior has the stiffness K_ii - K_ic K_cc⁻¹ K_ci, and R = K_cc⁻¹."""
    entries = {name: value for name, value in clamped(12).items() if name != "damping"} | {"load": np.eye(12)[1]}
    c = np.flatnonzero(entries["contact"].any(axis=0))
    i = np.delete(np.arange(12), c)
    K, M = entries["stiffness"], entries["mass"]
    residual = np.linalg.inv(K[np.ix_(c, c)])
    rows = -residual @ K[np.ix_(c, i)]
    condensed = {
        "mass": M[np.ix_(i, i)],
        "stiffness": K[np.ix_(i, i)] + K[np.ix_(i, c)] @ rows,
        "contact": rows,
        "tangent": entries["tangent"][:, i],
        "load": entries["load"][i],
        "residual_flexibility": residual,
    }
    full, exact = of_entries(entries, Rayleigh(mass=20)), of_entries(condensed, Rayleigh(mass=20))
    reduction = reduce_structure(full, 10, None, "massless")
    assert apart(reduced_run(reduction, rub(full), 0.01), run(exact, rub(exact), 0.01)) < 1e-9


@pytest.mark.parametrize("count", [1, 3])
def test_residual_flexibility_of_a_uniform_chain(count: int) -> None:
    """ω_j = 2 √(k/m) sin a_j/2, φ_ij = 2 sin(i a_j)/√(m (2n + 1)), a_j = (2j - 1) π/(2n + 1): MacNeal's R."""
    n, m, k = 8, 0.3, 5e4
    links = np.eye(n) - np.eye(n, k=-1)
    at, j = np.array([3, 8]), np.arange(1, n + 1)
    angles = (2 * j - 1) * np.pi / (2 * n + 1)
    modes = 2 / np.sqrt(m * (2 * n + 1)) * np.sin(np.outer(np.arange(1, n + 1), angles))
    squares = 4 * k / m * np.sin(angles / 2) ** 2
    exact = (modes[:, count:] / squares[count:]) @ modes[:, count:].T
    tangent, load = np.eye(n)[[1, 5]], np.eye(n)[4]
    entries = {"mass": m * np.eye(n), "stiffness": k * links.T @ links, "contact": np.eye(n)[at - 1]}
    full = of_entries(entries | {"tangent": tangent, "load": load})
    contacts = reduce_structure(full, count, None, "macneal").structure.contacts
    for ours, theirs in (
        (contacts.residual, exact[np.ix_(at - 1, at - 1)]),
        (contacts.residual_tangent, exact[at - 1] @ tangent.T),
        (contacts.residual_load, exact[at - 1] @ load),
    ):
        assert ours == pytest.approx(theirs, rel=1e-10, abs=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("basis", BASES)
def test_sparse_matrices_give_the_same_as_dense_ones(basis: str) -> None:
    """Rows of several entries; the last two contacts share a temperature."""
    n, heats = 310, 12
    rows = np.zeros((3, n))
    rows[0, [150, 151]], rows[1, [151, 152, 153]], rows[2, -1] = [0.5, 0.5], [0.2, 1.0, -0.3], 1.0
    links, heat_links = np.eye(n) - np.eye(n, k=-1), np.eye(heats) - np.eye(heats, k=-1)
    entries = clamped(n) | {
        "contact": rows,
        "tangent": 0.5 * np.eye(n)[[3, 100, 250]],
        "heat_capacity": 0.1 * np.eye(heats),
        "conductance": 5 * heat_links.T @ heat_links,
        "coupling": -20 * links.T @ np.repeat(np.eye(heats), 26, axis=0)[:n],
        "thermal_contact": np.eye(heats)[[6, 11, 11]],
    }
    del entries["damping"]
    sparse = of_entries(entries, Rayleigh(mass=20.0), _sparse_structure)
    dense = sparse.matrices()
    batch = rub(dense, alpha=0.01, gaps=[1.6e-7, 1.46e-7, 4e-7])
    ours, theirs = (reduce_structure(structure, 8, 4, basis, DURATION) for structure in (sparse, dense))
    a, b = ours.structure, theirs.structure
    assert (a.mechanical_size, a.thermal_size) == (b.mechanical_size, b.thermal_size)
    assert b.mechanical_size == (8 if basis in WITHOUT_MASS else 14)  # three contacts, three tangents
    assert models.frequencies(a) == pytest.approx(models.frequencies(b), rel=1e-8)
    assert static(a, 0.1) == pytest.approx(static(b, 0.1), rel=1e-9)
    assert static(a, 0.1) == pytest.approx(static(dense, 0.1), rel=1e-9)
    lost = [projection_residual(full, one, batch)[0] for full, one in ((sparse, ours), (dense, theirs))]
    assert lost[0] == pytest.approx(lost[1], abs=1e-8)
    whole = reduced_run(theirs, batch, 0.003)
    assert whole.histories["impulse"].max(axis=2).min() > 0
    assert apart(reduced_run(ours, batch, 0.003), whole) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("basis", BASES)
def test_two_opposite_stops(basis: str) -> None:
    """Of rows w and -2 w one is held; without mass both stops have one residual flexibility, and R is singular."""
    entries, ends = clamped(20), np.eye(20)[[-1, 9, -1]] * np.array([[1.0], [-1.0], [-2.0]])
    full = of_entries(entries | {"contact": ends, "tangent": np.zeros((3, 20))})
    batch = rub(full, gaps=[2e-7, 1e-7, 5e-7])
    reduction = reduce_structure(full, 18, None, basis, DURATION)
    assert reduction.structure.mechanical_size == (18 if basis in WITHOUT_MASS else 20)
    assert static(reduction.structure, 0.0) == pytest.approx(static(full, 0.0), rel=1e-9)
    ours = reduced_run(reduction, batch, 0.01)
    assert ours.status.tolist() == [0]
    assert ours.histories["impulse"].max(axis=2).min() > 0
    if basis not in WITHOUT_MASS:
        assert apart(ours, run(full, batch, 0.01)) < 1e-9
    if basis == "massless":
        over, small, case = scenes.sampling(0.01, 1e-4), reduction.structure, scenes.movable(reduction.project(batch))
        errors = [apart(scenes.step(small, case, h, over, theta=0.5), ours) for h in (2.5e-7, 6.25e-8)]
        assert errors[1] < 0.5 * errors[0] < 0.03
    slides = of_entries(entries | {"contact": ends, "tangent": np.eye(20)[[4, 8, 12]]})  # each in its own direction
    few = reduce_structure(slides, 3, None, basis, DURATION).structure
    for friction in (0.0, 0.3, -0.8):
        assert static(few, friction) == pytest.approx(static(slides, friction), rel=1e-9)


@pytest.mark.parametrize("basis", BASES)
def test_a_free_rod_between_two_walls(basis: str) -> None:
    """Its rigid motion is kept or the contacts keep their mass; with all modes Craig–Bampton loses nothing."""
    links = np.diff(np.eye(8), axis=0)
    entries = {"mass": 0.1 * np.eye(8), "stiffness": 4e5 * links.T @ links, "load": np.eye(8)[3]}
    full = of_entries(entries | {"contact": np.eye(8)[[7, 0]] * np.array([[1.0], [-1.0]])}, Rayleigh(mass=2.0))
    batch = rub(full, gaps=[1e-4, 2e-4])
    for count in (0, 2, 6):
        reduction = reduce_structure(full, count, 0, basis, DURATION)
        assert reduction.structure.contacts.is_massless == (basis in WITHOUT_MASS and count > 0)
        assert models.frequencies(reduction.structure)[0] == 0.0
        assert critical_alpha(reduction.structure) == np.inf
        ours = reduced_run(reduction, batch, 0.1)
        assert ours.status.tolist() == [0]
        assert ours.histories["impulse"].max(axis=2).min() > 0
    if basis == "craig_bampton":
        assert apart(ours, run(full, batch, 0.1)) < 1e-9


@pytest.mark.parametrize("basis", WITHOUT_MASS)
def test_one_contact_is_the_structure_of_a_file_with_its_residuals(basis: str, tmp_path: Path) -> None:
    full = scenes.heavy_chain()
    reduction = reduce_structure(full, 3, 5, basis)
    small = reduction.structure
    c, names = small.contacts, ("residual_tangent", "residual_coupling", "residual_load")
    entries = {"contact": c.normal, "thermal_contact": c.heat, "load": small.load_direction, **matrices_of(small)}
    entries |= {"damping": small.damping_matrix, "residual_flexibility": c.residual}
    file = write_matrices(tmp_path / "small.npz", **entries, **{name: getattr(c, name) for name in names})
    written = scenes.of_file(file)
    assert critical_alpha(written) == pytest.approx(critical_alpha(full), rel=1e-9)
    values: dict[str, Any] = {"alpha": 0.5, "gap": 5e-5, "amplitude": 100.0, "frequency": 20.0}
    exact = reduced_run(reduction, scenes.cases(full, **values), 0.05)
    assert exact.histories["impulse"][0, -1] > 0
    assert exact.metrics["impacts"].tolist() == [0]
    assert apart(run(written, scenes.cases(written, **values), 0.05), exact) < 1e-9


@pytest.mark.parametrize("basis", WITHOUT_MASS)
def test_without_modes_contacts_follow_their_loads(basis: str) -> None:
    """Static answers alone: x = w K1⁻¹ b F, and the force that keeps it at the casing."""
    full = of_entries(clamped(12) | {"contact": np.eye(12)[[-1]], "tangent": np.eye(12)[[0]]})
    batch = rub(full, friction=0.0, amplitude=30.0)
    ours = reduced_run(reduce_structure(full, 0, 0, basis), batch, 0.01)
    flexibility = static(full, 0.0).item()
    t = np.linspace(0.0, 0.01, 101)
    load = 30.0 * np.sin(2 * np.pi * 300 * t + 0.2)
    place = np.minimum(flexibility * load, batch.gaps[0, 0])
    assert ours.histories["displacement"][0] == pytest.approx(place, rel=1e-9, abs=1e-12 * batch.gaps[0, 0])
    fine = np.linspace(0.0, 0.01, 1_000_001)
    force = np.maximum(0.0, 30.0 * np.sin(2 * np.pi * 300 * fine + 0.2) - batch.gaps[0, 0] / flexibility)
    assert ours.histories["impulse"][0, -1] == pytest.approx(np.trapezoid(force, fine), rel=1e-6)


@pytest.mark.parametrize("basis", WITHOUT_MASS)
@pytest.mark.parametrize("gaps", [[1.0, 1.0], [2e-7, 4e-7]])
def test_constant_loads_act_on_contacts_without_mass(basis: str, gaps: list[float]) -> None:
    """At rest, free or pressed, places and forces are those of the full structure; ``Cases.offset`` holds the rest."""
    full = of_entries(clamped(20))
    batch = rub(full, steady=np.linspace(0.0, 3.0, 20), amplitude=0.0, gaps=gaps)
    reduction = reduce_structure(full, 1, None, basis)
    small = reduction.project(batch)
    assert np.abs(small.offset).min() > 0
    ours = run(reduction.structure, at_rest(reduction.structure, small), 1e-3)
    rest = at_rest(full, batch)
    place = full.contacts.normal @ rest.displacement[0]
    assert ours.histories["displacement"][0] == pytest.approx(np.tile(place[:, None], 101), rel=1e-9)
    theirs = run(full, rest, 1e-3)
    impulse, most = ours.histories["impulse"], np.abs(theirs.histories["impulse"]).max()
    assert impulse == pytest.approx(theirs.histories["impulse"], abs=1e-9 * most)
    assert projection_residual(full, reduction, batch)[0] < 1


def test_a_basis_says_which_contacts_it_does_not_take() -> None:
    with pytest.raises(ValueError, match="contacts without mass"):
        reduce_structure(drawn(3, massless=True).structure, 1, 0)


def test_contacts_without_mass_have_no_temperature_over_a_depth() -> None:
    structure = scenes.observing(reduce_structure(scenes.heavy_chain(), 3, 5, "massless").structure, np.ones(6))
    for scheme in ("event_driven", "moreau"):
        with pytest.raises(ValueError, match="temperature over a depth at contacts without mass"):
            schemes.load(scheme).init(structure, 1e-6, schemes.load(scheme).Options())


@pytest.mark.slow
def test_a_study_takes_counts_and_bases_of_several_contacts(tmp_path: Path) -> None:
    """Three modes are all of five displacements with two contacts, and three all of five temperatures."""
    given = study(
        tmp_path,
        chain(),
        axes={
            "scheme": ["event_driven", "moreau"],
            "reduction": list(BASES),
            "mechanical_modes": [1, 3],
            "thermal_modes": 3,
            "alpha": 10,
            "h": 1e-5,
        },
        reference={"scheme": "event_driven", "mechanical_modes": "full", "thermal_modes": "full"},
    )
    assert not [warning for warning in plan_study(given).warnings if "fails" in warning]
    archive = run_study(given, tmp_path / "a.nc", threads=1).dataset.load().squeeze()
    assert (archive["status"] == 0).all()
    assert archive["displacement"].dims == ("scheme", "reduction", "mechanical_modes", "contact", "t")
    exact = archive.sel(scheme="event_driven")
    assert float(exact["impulse_error"].sel(reduction="craig_bampton", mechanical_modes=3)) < 1e-9
    assert (exact["impulse_error"].sel(mechanical_modes=1) > 1e-4).all()
    assert (archive["projection_residual"].sel(reduction="craig_bampton", mechanical_modes=3) < 1e-9).all()
    assert (archive["impulse_scheme_error"].sel(scheme="moreau") > 0).all()
    assert (archive["impulse_model_error"].sel(mechanical_modes=1) > 1e-4).all()


def test_auto_meets_its_tolerance_on_each_contact(tmp_path: Path) -> None:
    """Checked against the full structure of 12 displacements and temperatures."""
    links = np.eye(12) - np.eye(12, k=-1)
    heat = {"heat_capacity": 0.1 * np.eye(12), "conductance": 5 * links.T @ links, "coupling": -20 * links.T}
    shares = {"thermal_contact": np.eye(12)[[6, 11]]}
    made = clamped(12) | heat | shares | {"contact_labels": ["mid", "end"]}
    scene = {
        "matrices": {"file": str(write_matrices(tmp_path / "rod.npz", **made))},
        "casing": {"gap": [2e-7, 4e-7]},
        "load": {"amplitude": 20.0, "frequency": 300.0},
        "duration": 0.01,
    }
    modes = {"mechanical_modes": "auto", "thermal_modes": "auto", "tolerance": 0.02}
    axes = {"scheme": "event_driven", "reduction": "krylov", "alpha": 0.5, "e": 0}
    text = {"study": "auto", "scene": scene, "output": {"interval": 1e-4, "histories": ["displacement", "temperature"]}}
    whole, chosen = (
        run_study(text | {"axes": axes | more}, tmp_path / f"{len(more)}.nc", threads=1).dataset.load()
        for more in ({}, modes)
    )
    assert int(decided(chosen)[0].mechanical_modes) < 10
    for name in ("displacement", "temperature"):
        own, full = (run[name].transpose(..., "contact", "t").values for run in (chosen, whole))
        assert (np.linalg.norm(own - full, axis=-1) < 0.02 * np.linalg.norm(full, axis=-1)).all()
