"""event_driven with several contacts: scenes solved in 80 bits by another program, closed forms, uncoupled copies."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workflow
from workflow import schemes
from workflow.models import Cases, Contacts, Harmonics, Matrices, Rayleigh
from workflow.models._from_matrices import GivenMatrices, structure_from_matrices
from workflow.schemes import Results, Sampling

SCENES = Path(__file__).parent / "scenes"
"""Made by an event-driven solver in 80-bit arithmetic: Taylor polynomials, Bernstein subdivision, Lemke's method."""


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.yaml")))
def test_scenes_of_an_independent_exact_solver(name: str, tmp_path: Path) -> None:
    archive = workflow.run_study(workflow.read_study(SCENES / f"{name}.yaml"), tmp_path / f"{name}.nc").dataset
    ours, exact = archive.squeeze(), np.load(SCENES / f"{name}_exact.npz")
    assert ours["displacement"].dims == ("contact", "t")
    assert int(ours["status"]) == 0
    for variable in ("displacement", "impulse"):
        assert ours[variable].values == pytest.approx(exact[variable], abs=1e-9 * np.abs(exact[variable]).max())
    assert ours["contact_impulse"].values == pytest.approx(exact["contact_impulse"], rel=1e-9)
    assert ours["contact_time"].values == pytest.approx(exact["contact_time"], abs=2e-5 * exact["contact_time"].max())
    if "temperature" in exact:
        assert ours["temperature"].values == pytest.approx(exact["temperature"], abs=1e-9 * exact["temperature"].max())
    archive.close()


def structure(
    mass: Any, stiffness: Any, rows: Any, *, load: Any = None, damping: Rayleigh | None = None, **residual: Any
) -> Matrices:
    """Return a cold structure with contacts along rows."""
    M, K, W = (np.atleast_2d(np.asarray(value, dtype=float)) for value in (mass, stiffness, rows))
    n, still = len(M), np.zeros(len(M))
    given = GivenMatrices(
        M, K, np.zeros((n, 1)), 1e30 * np.eye(1), np.zeros((1, 1)), W[0], np.ones(1), still, np.zeros(1)
    )
    own = structure_from_matrices(replace(given, load=load, damping=damping or Rayleigh()))
    basis = own.coordinates.displacement_basis
    labels, heat = tuple(map(str, range(len(W)))), np.ones((len(W), 1))
    contacts = Contacts(labels, W @ basis, np.zeros_like(W) @ basis, heat, np.zeros(len(W)), **residual)
    return replace(own, contacts=contacts)


def run(own: Matrices, gaps: Any, times: Any, **given: Any) -> Results:
    """Return the exact results of one case."""
    n, gaps = len(own.coordinates.displacement_basis), np.atleast_2d(np.asarray(gaps, dtype=float))
    values: dict[str, Any] = {name: np.array([given.pop(name, 0.0)]) for name in ("e", "alpha", "mean", "friction")}
    rows = {name: np.broadcast_to(given.pop(name, 0.0), (1, n)) for name in ("steady", "displacement", "velocity")}
    load = np.array(given.pop("load", np.zeros((0, 3)))).reshape(-1, 3).T[:, None]
    casing = np.array(given.pop("casing", np.zeros((0, 3)))).reshape(-1, 3).T[:, None]
    assert not given
    zero = np.zeros((1, 1))
    cases = Cases(
        **values,
        gap=gaps[:, 0],
        **rows,
        heating=zero,
        temperature=zero,
        load_harmonics=Harmonics(*load),
        casing_harmonics=Harmonics(*casing),
        gaps=gaps,
    )
    exact = schemes.load("event_driven")
    sampling = Sampling(times[-1], times[1], len(times))
    return exact.compute(exact.init(own, 0.0, exact.Options()), own.coordinates.transformed(cases), sampling)


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_ball_between_floor_and_ceiling(e: float) -> None:
    """A free mass flies from stop to stop: speeds are multiplied by e, flights last 2/speed."""
    times = np.linspace(0, 30, 301)
    ours = run(structure(1.0, 0.0, [[1.0], [-1.0]]), [1.0, 1.0], times, e=e, velocity=1.0)
    x, v, t, place = 0.0, 1.0, 0.0, np.empty(times.size)
    jumps = []
    for k, now in enumerate(times):
        while v != 0 and (hit := t + (np.sign(v) - x) / v) <= now:
            x, t = np.sign(v), hit
            jumps.append((1 + e) * abs(v))
            v = -e * v
        place[k] = x + v * (now - t)
    assert ours.histories["displacement"][0] == pytest.approx(np.stack([place, -place]), abs=1e-12)
    assert ours.metrics["impacts"][0] == pytest.approx([(len(jumps) + 1) // 2, len(jumps) // 2])
    assert ours.histories["impulse"][0, :, -1].sum() == pytest.approx(sum(jumps), rel=1e-13)


def test_two_stops_pressed_in_turn() -> None:
    """A mass without spring under a slow load rests on one stop, crosses and rests on the other: F/m twice."""
    times = np.linspace(0, 1, 11)
    ours = run(structure(2.0, 0.0, [[1.0], [-1.0]], load=np.ones(1)), [0.5, 0.5], times, steady=3.0, displacement=0.5)
    assert ours.histories["impulse"][0, 0] == pytest.approx(3.0 * times, abs=1e-12)
    assert ours.histories["displacement"][0] == pytest.approx(np.outer([1, -1], np.full(11, 0.5)), abs=1e-15)
    assert ours.metrics["contact_time"][0] == pytest.approx([1.0, 0.0])


def clamped_chain(count: int) -> tuple[Any, Any]:
    links = np.eye(count) - np.eye(count, k=-1)
    return np.diag(np.linspace(1.0, 0.6, count)), 4e4 * links.T @ links


@pytest.mark.parametrize("count", [2, 5])
def test_uncoupled_copies_give_the_run_of_one(count: int) -> None:
    M, K = clamped_chain(4)
    each, times = np.eye(count), np.linspace(0, 0.3, 61)
    moving: dict[str, Any] = {"load": [[9.0, 11.0, 0.3]], "casing": [[2e-4, 7.0, 0.4]]}
    rows = [np.kron(one, np.eye(4)[3]) for one in each]
    many = structure(
        np.kron(each, M), np.kron(each, K), rows, load=np.tile(np.eye(4)[3], count), damping=Rayleigh(mass=3.0)
    )
    ours = run(many, np.full(count, 3e-4), times, **moving)
    single = structure_from_matrices(
        GivenMatrices(
            M, K, np.zeros((4, 1)), 1e30 * np.eye(1), np.zeros((1, 1)), np.eye(4)[3], np.ones(1), np.zeros(4),
            np.zeros(1), damping=Rayleigh(mass=3.0),
        )
    )  # fmt: skip
    alone = run(single, [[3e-4]], times, **moving)
    assert alone.metrics["impacts"][0] > 3
    for name in ("displacement", "impulse"):
        one = alone.histories[name][0]
        assert ours.histories[name][0] == pytest.approx(np.tile(one, (count, 1)), abs=1e-12 * np.abs(one).max())


def test_a_contact_without_mass_is_a_spring_in_series() -> None:
    """A mass that strikes an elastic stop of stiffness 1/R: half a sine, and the impulse 2 m v k/(k + c)."""
    m, k, R, v = 100.0, 1e4, 1e-6, 1.0
    own = structure(m, k, [[1.0]], residual=np.array([[R]]), residual_tangent=np.zeros((1, 1)))
    times = np.linspace(0, 0.06, 601)
    ours = run(own, [[0.0]], times, velocity=v)
    w, force = np.sqrt((k + 1 / R) / m), (1 / R) * v / np.sqrt((k + 1 / R) / m)
    inside = np.minimum(times, np.pi / w)
    assert ours.metrics["contact_time"][0] == pytest.approx(np.pi / w, rel=1e-12)
    assert ours.histories["impulse"][0] == pytest.approx(force / w * (1 - np.cos(w * inside)), abs=1e-11)
    assert ours.histories["impulse"][0, -1] == pytest.approx(198.0198019802, rel=1e-10)
    assert ours.metrics["impacts"][0] == 0
