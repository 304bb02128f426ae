"""Rigid motions that a closed set does not touch, soft bodies, equal blades."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import cases_of_file, of_entries, sampling, step
from workflow.models import Array, Cases, ContactBasis, Structure, analyse_contacts, contact_system
from workflow.poles import propagated_error, real_blocks
from workflow.schemes import Sampling


def free_beam(count: int, seed: int, heated: bool = True) -> dict[str, Any]:
    """Return a beam of masses that nothing holds, a stop under each end, which bends as its ends warm."""
    rng = np.random.default_rng(seed)
    place = np.cumsum(rng.uniform(0.02, 0.05, count))
    bends = np.zeros((count - 2, count))
    for i, (a, b) in enumerate(zip(np.diff(place)[:-1], np.diff(place)[1:], strict=True)):
        bends[i, i : i + 3] = 1 / a, -1 / a - 1 / b, 1 / b
    mass, rigidity = np.diag(rng.uniform(0.008, 0.02, count)), np.diag(rng.uniform(20, 60, count - 2))
    stiffness, ends = bends.T @ rigidity @ bends, np.eye(count)[[0, -1]]
    entries = {"mass": mass, "stiffness": stiffness, "contact": ends, "load": np.ones(count) / count}
    entries["damping"] = 3e-6 * stiffness
    if heated:
        entries |= {
            "heat_capacity": np.diag([0.6, 0.8]),
            "conductance": np.array([[30.0, -8.0], [-8.0, 25.0]]),
            "coupling": -bends.T @ rigidity @ np.full((count - 2, 2), 1e-3),
            "thermal_contact": np.eye(2),
        }
    return entries


def blades(blades: int = 2, count: int = 6) -> dict[str, Any]:
    """Return equal chains that nothing joins, heated at their tips."""
    links, each, tip = np.eye(count) - np.eye(count, k=-1), np.eye(blades), np.eye(count)[-1]
    chain = {
        "mass": 0.012 * np.eye(count),
        "stiffness": 2e6 * links.T @ links,
        "damping": 0.072 * np.eye(count) + 1.6 * links.T @ links,
        "heat_capacity": 0.3 * np.eye(count),
        "conductance": 0.03 * np.eye(count) + 0.5 * links.T @ links,
        "coupling": -0.2 * links.T @ (np.eye(count) + np.eye(count, k=-1)),
    }
    entries: dict[str, Any] = {name: np.kron(each, matrix) for name, matrix in chain.items()}
    return entries | {
        "contact": np.kron(each, tip),
        "thermal_contact": np.kron(each, tip),
        "load": np.tile(tip, blades),
    }


def basis_of(entries: dict[str, Any], flexibility: float = 0.0) -> ContactBasis:
    basis = analyse_contacts(of_entries(entries))
    basis = replace(basis, contacts=replace(basis.contacts, casing_flexibility=flexibility))
    return basis if "heat_capacity" in entries else basis.unheated


FREE: dict[str, tuple[ContactBasis, float]] = {
    "heat": (basis_of(free_beam(3, 5)), 2.0),
    "elastic stops": (basis_of(free_beam(4, 1, heated=False), 1e-6), 0.0),
    "heat on elastic stops": (basis_of(free_beam(5, 2), 1e-6), 2.0),
}


@pytest.mark.parametrize("name", FREE)
@pytest.mark.parametrize("closed", [[True, False], [False, True], [False, False]])
def test_nothing_depends_on_the_place_of_a_rigid_motion_that_a_set_does_not_touch(
    name: str, closed: list[bool]
) -> None:
    (basis, alpha), count = FREE[name], 2 - sum(closed)
    system = contact_system(basis, np.array(closed), alpha, 0.0)
    assert system is not None
    assert not system.A[:, :count].any()
    touched = basis.normal[np.array(closed)] @ system.null[:, :count]
    assert np.abs(touched).max(initial=0.0) < 1e-14 * np.abs(basis.normal).max()
    blocks = real_blocks(system.A, 0.1)
    assert np.sum(blocks.stiffness == 0) == count
    assert propagated_error(system.A, blocks, 0.1) < 1e-12


def test_equal_blades_warm_as_one_alone() -> None:
    """At α at which both had an inverse that is none; the last two, 1e-9 apart, differ by as much."""
    alpha = np.append(np.linspace(1, 30, 465)[[4, 30, 46, 95, 142, 190, 225, 306, 322]], [15.396825396825395] * 2)
    alpha[-1] *= 1 + 1e-9
    loads = {"load_harmonics": [[26.0, 60.0, 0.3]], "casing_harmonics": [[8e-6, 120.0, 0.1], [3e-6, 300.0, 0.7]]}
    found = []
    for count in (1, 2):
        structure = of_entries(blades(count))
        gaps: dict[str, Any] = {"gap": 5e-5} if count == 1 else {"gaps": [5e-5] * 2}
        case = cases_of_file(structure, alpha.size, e=0.5, alpha=alpha, **gaps, **loads)
        ours = step(structure, case, 0.0, Sampling(0.05, 1e-3, 51), "event_driven")
        assert not ours.status.any()
        found.append([ours.histories[name].reshape(alpha.size, count, 51) for name in ("impulse", "temperature")])
    for one, two in zip(*found, strict=True):
        largest = np.abs(one).max(axis=(1, 2), keepdims=True)
        assert np.broadcast_to(one / largest, two.shape) == pytest.approx(two / largest, abs=1e-9)
        assert two[-1] == pytest.approx(two[-2], abs=1e-8 * largest.max())


def test_a_load_moves_a_slow_block_by_its_velocity() -> None:
    """A soft body whose damping couples modes, 1e-5 of its highest frequency: q of the slow block is a velocity."""
    stiffness, loose = np.array([[1e10, -1e10], [-1e10, 1e10]]), np.diag([1.0, 0.3])
    K, C = stiffness + loose, 1e-6 * stiffness + np.diag([0.3, 0.05])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -C]])
    blocks = real_blocks(A)
    slow = blocks.outward[:, blocks.damping.size]  # per u of the slowest block
    assert np.abs(slow[:2]).max() < 1e-8 * np.abs(slow[2:]).max()


def drawn(seed: int) -> tuple[Structure, Cases, Sampling]:
    """Return a free body or beam with heat, friction or elastic stops, and a case over some contacts."""
    rng = np.random.default_rng(seed)
    kind, count = ("heat", "friction", "elastic")[seed % 3], int(rng.integers(3, 6))
    entries = free_beam(count, seed, heated=kind == "heat")
    if seed % 2:  # a body: coordinates turned and sheared, so that its rigid motions stay two
        turn = np.eye(count) + 0.3 * rng.normal(size=(count, count))
        for name in ("mass", "stiffness", "damping"):
            entries[name] = turn.T @ entries[name] @ turn
        for name in ("contact", "load"):
            entries[name] = entries[name] @ turn
        if kind == "heat":
            entries["coupling"] = turn.T @ entries["coupling"]
    if kind == "friction":
        entries["tangent"] = 0.3 * rng.normal(size=(2, count))
    structure = of_entries(entries)
    if kind == "elastic":
        structure = replace(structure, contacts=replace(structure.contacts, casing_flexibility=1e-5))
    given: dict[str, Any] = {"gaps": [2e-4, 3e-4], "e": rng.choice([0.0, 0.3]), "mean": 20.0}
    given |= {"alpha": 2.0 * (kind == "heat"), "friction": 0.1 * (kind == "friction")}
    case = cases_of_file(structure, load_harmonics=[[25.0, 60.0, 0.3]], **given)
    return structure, case, sampling(0.01, 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(60))
def test_random_free_bodies_are_what_the_theta_method_comes_to(seed: int) -> None:
    """The error of a step is of the first order; with impacts it jumps, on elastic stops two steps extrapolate it."""
    structure, case, over = drawn(seed)
    exact = step(structure, case, 0.0, over, "event_driven")
    assert exact.status[0] == 0
    place = exact.histories["displacement"]

    def error(other: Array) -> float:
        return float(np.abs(other - place).max() / np.abs(place).max())

    def stepped(h: float) -> Array:
        return step(structure, case, h, over, theta=0.5).histories["displacement"]

    if seed % 3 == 2:
        coarse, fine = stepped(5e-7), stepped(2.5e-7)
        assert error(fine) == pytest.approx(error(coarse) / 2, rel=0.03)
        assert error(2 * fine - coarse) < 2e-4
    else:
        assert error(stepped(6.25e-8)) < min(3e-4, error(stepped(8e-6)) / 16)
