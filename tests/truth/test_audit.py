"""Scenes of an independent audit: event solver in 80-bit arithmetic, or closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from workflow import read_study, run_study
from workflow.schemes import Status

SCENES = Path(__file__).parent / "audit"


def solved(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    """Run a scene of the audit."""
    study = read_study(SCENES / f"{name}.yaml").with_(settings)
    return run_study(study, tmp_path / "x.nc", threads=1).dataset.load()


def oscillator(t: np.ndarray, w: float, ratio: float, force: float, load: float) -> np.ndarray:
    """Return the motion from rest of x'' + 2 ζ w x' + w² x = F sin(Ω t)."""
    if w == 0:
        return force * (t / load - np.sin(load * t) / load**2)
    amplitude = force / complex(w * w - load * load, 2 * ratio * w * load)
    pole = complex(-ratio * w, w * np.sqrt(1 - ratio**2))
    x0, v0 = -amplitude.imag, -load * amplitude.real
    free = complex(x0, (pole.real * x0 - v0) / pole.imag)  # Re[free e^{pole t}] has the value x0 and the slope v0
    return np.imag(amplitude * np.exp(1j * load * t)) + np.real(free * np.exp(pole * t))


def test_a_free_root_under_a_fast_load_flies_as_in_closed_form(tmp_path: Path) -> None:
    archive = solved("free_flight_of_modes", tmp_path)
    t, load = archive["t"].values, 2 * np.pi * 2000
    modes = [(0.0, 0.0), (2 * np.pi * 1000, 0.02), (2 * np.pi * 5000, 0.03)]
    exact = sum(oscillator(t, w, ratio, 1.0, load) for w, ratio in modes)
    x = archive["displacement"].sel(scheme="event_driven").values.ravel()
    assert np.abs(exact).max() == pytest.approx(7.98e-7, rel=1e-3)
    np.testing.assert_allclose(x, exact, rtol=0, atol=1e-9 * np.abs(exact).max())
    midpoint = archive.sel(scheme="midpoint").squeeze()
    error = np.linalg.norm(midpoint["displacement"] - exact) / np.linalg.norm(exact)
    assert float(midpoint["displacement_error"]) == pytest.approx(error, rel=1e-3)


def test_a_lightly_damped_ball_flies_as_in_closed_form(tmp_path: Path) -> None:
    """With γ = c/m: x'' + γ x' = (F/m) sin(Ω t + φ) from rest."""
    import mpmath as mp

    archive = solved("ball_lightly_damped", tmp_path)
    mass, force, load, phase = mp.mpf("1e-2"), 5, 2 * mp.pi * 3000, mp.mpf("1.57")
    mp.mp.dps = 60
    for damping, motion in zip(archive["mass"].values.ravel(), archive["displacement"].values, strict=True):
        gamma = mp.mpf(float(damping))
        pair = force / mass * mp.exp(1j * phase) / (1j * load * (1j * load + gamma))

        def place(t: float, gamma: mp.mpf = gamma, pair: mp.mpc = pair) -> float:
            particular = mp.im(pair * mp.exp(1j * load * t))
            x0, v0 = -mp.im(pair), -mp.im(1j * load * pair)
            return float(particular + x0 + v0 * (t if gamma == 0 else -mp.expm1(-gamma * t) / gamma))

        exact = np.array([place(t) for t in archive["t"].values[::50]])
        np.testing.assert_allclose(motion[::50], exact, rtol=0, atol=1e-9 * np.abs(exact).max())


def test_the_hottest_moment_of_a_held_tip_whose_poles_are_all_complex(tmp_path: Path) -> None:
    archive = solved("hottest_moment", tmp_path).sel(scheme="event_driven")
    assert float(archive["max_temperature"].squeeze()) == pytest.approx(6.521667013224, rel=1e-9)
    assert float(archive["temperature"].isel(t=-1).squeeze()) == pytest.approx(5.697016726177, rel=1e-9)


def test_a_state_that_leaves_the_numbers_ends_its_case(tmp_path: Path) -> None:
    """Growth rate times duration is 943: the exponential overflows."""
    archive = solved("never_ends", tmp_path)
    assert int(archive["status"]) == int(Status.DIVERGED)
    assert int(archive["runaway"]) == 1
    assert "left the finite numbers" in str(archive["message"].values)


def test_heat_on_a_temperature_without_heat_capacity_pushes_the_structure(tmp_path: Path) -> None:
    archive = solved("heated_without_capacity", tmp_path)
    exact = archive.sel(scheme="event_driven").squeeze()
    assert float(exact["contact_impulse"]) == pytest.approx(0.06404588799630, rel=1e-9)
    assert float(exact["temperature"].isel(t=-1)) == pytest.approx(1.606764362717, rel=1e-9)
    assert float(archive["contact_impulse"].sel(scheme="moreau").squeeze()) == pytest.approx(0.06404588799630, rel=0.02)
