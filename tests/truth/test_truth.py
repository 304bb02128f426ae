"""The gallery of truth: what each study of ``studies/truth`` must come to, by closed forms and published numbers."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from workflow import read_study, run_study
from workflow.schemes import Status

ROOT = Path(__file__).parents[2]


def truth(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    """Run a study of the gallery."""
    study = read_study(ROOT / "studies" / "truth" / f"{name}.yaml")
    tmp_path.mkdir(exist_ok=True)
    archive = run_study(study.with_(settings) if settings else study, tmp_path / "x.nc", threads=1).dataset.load()
    assert (archive["status"] == int(Status.OK)).all()
    return archive


def test_a_ball_on_a_vibrating_table(tmp_path: Path) -> None:
    """Period one: v⁺ = -π g/ω, V = v⁺ (1 - e)/(1 + e), an impact in the middle of every period, for ever."""
    archive = truth("ball_on_table", tmp_path)
    mass, weight, omega, a, e = 0.01, 0.0981, 2 * np.pi * 50, 80e-6, 0.8
    speed = np.pi * weight / mass / omega
    psi = -np.arccos(-speed * (1 - e) / (1 + e) / (a * omega))
    assert a * omega * np.cos(psi) == pytest.approx(-speed * (1 - e) / (1 + e))
    place = a * np.sin(psi)
    middle = place - speed * 0.005  # g T²/8 = v T/4
    assert int(archive["impacts"]) == 1000
    assert float(archive["contact_time"]) == 0.0
    np.testing.assert_allclose(archive["displacement"].values.ravel(), middle, rtol=1e-9)
    np.testing.assert_allclose(archive["velocity"].values.ravel(), 0.0, atol=1e-9 * speed)
    np.testing.assert_allclose(archive["period_impulse"].values.ravel(), 2 * mass * speed, rtol=1e-9)


def test_the_vibro_impact_oscillator_of_recipes_for_continuation(tmp_path: Path) -> None:
    """Dankowicz, Schilder (SIAM 2013), example 15.2: v⁻ = 1.695732937595, v⁺ = -1.356586350076."""
    speeds = truth("vibro_impact", tmp_path)["period_impulse"].values.ravel()[70:] / 1.8
    np.testing.assert_allclose(speeds, 1.695732937595, rtol=0, atol=1e-11)
    np.testing.assert_allclose(0.8 * speeds, 1.356586350076, rtol=0, atol=1e-11)


def test_it_grazes_at_a_tenth(tmp_path: Path) -> None:
    impacts = truth("vibro_impact_grazing", tmp_path)["impacts"].values.ravel()
    assert impacts[0] == 0
    assert impacts[1] > 0


COCO, SHAW_HOLMES, BALL = 1.8 * 1.695732937595, 1.8 * 20 / 3, 2 * 0.01 * 9.81 / 100
"""Impulses of an impact: (1 + e) v⁻ of unit masses, 2 m v⁺ with v⁺ = π g/ω."""


@pytest.mark.parametrize(
    ("name", "period", "impulse", "impacts", "largest"),
    [
        ("vibro_impact", 2 * np.pi, COCO, 99, (2.5e-3, 3e-5)),
        ("impact_oscillator", np.pi, SHAW_HOLMES, 50, (2.2e-2, 4.5e-4)),
        ("ball_on_table", 0.02, BALL, 1000, (2e-6, 1e-6)),
    ],
)
def test_fixed_steps_meet_closed_forms_to_their_order(
    name: str, period: float, impulse: float, impacts: int, largest: tuple[float, float], tmp_path: Path
) -> None:
    """Mean impulse of the last third of the periods: of θ = 1 to the first order, of θ = 1/2 far closer.

    Impacts are in contact for one step each.
    """
    errors = []
    for steps in (250, 1000):
        h = period / steps
        archive = truth(
            name,
            tmp_path / str(steps),
            **{
                "schemes": {"midpoint": {"method": "moreau", "theta": 0.5}},
                "axes.scheme": ["moreau", "midpoint"],
                "axes.h": h,
            },
        )
        assert (archive["impacts"] == impacts).all()
        np.testing.assert_allclose(archive["contact_time"], impacts * h, rtol=1e-12)
        impulses = archive["period_impulse"].transpose("scheme", "period", ...).values.reshape(2, -1)
        mean = impulses[:, 2 * impulses.shape[1] // 3 :].mean(axis=1)
        errors.append(np.abs(mean / impulse - 1.0))
    assert (errors[-1] < largest).all(), errors
    if name != "ball_on_table":  # its free flight is exact in the mean, and only the phase of impacts is not
        assert np.log(errors[0][0] / errors[1][0]) / np.log(4) == pytest.approx(1.0, abs=0.06)
        assert errors[1][1] < errors[0][1] / 4


def test_the_impact_oscillator_of_shaw_and_holmes(tmp_path: Path) -> None:
    """J. Sound Vib. 90 (1983) 129-155, r = 0.8, ω = 2: v⁻ = 20/3."""
    archive = truth("impact_oscillator", tmp_path)
    np.testing.assert_allclose(archive["period_impulse"].values.ravel() / 1.8, 20 / 3, rtol=1e-12)


def test_its_period_doubles(tmp_path: Path) -> None:
    """At ω = 2.653347727855 a multiplier is -1: the impulses of the periods deviate by turns, as much each time."""
    archive = truth("period_doubling", tmp_path)
    assert 2 * np.pi * float(archive["frequency"][1]) == pytest.approx(2.653347727855, abs=1e-12)
    impulse = archive["period_impulse"].transpose("frequency", "period", ...).values.reshape(3, -1)
    changes = np.diff(impulse, axis=1)
    below, at, above = changes[:, -1] / changes[:, -2]
    assert at == pytest.approx(-1.0, abs=1e-6)
    assert above < -1.005 < -0.995 < below


@pytest.mark.parametrize("scheme", ["event_driven", "midpoint", "carpenter"])
def test_the_impact_of_a_bar(scheme: str, tmp_path: Path) -> None:
    """Doyen, Ern, Piperno (SIAM J. Sci. Comput. 33, 2011): ρ c v₀ = 300 for 2 L/c, then -v₀; to the width of a cell."""
    archive = truth("impact_bar", tmp_path, **{"axes.scheme": [scheme]})
    impulse, t = archive["impulse"].values.ravel(), archive["t"].values
    force, middle = np.diff(impulse) / 5e-3, t[1:] - 2.5e-3
    assert force[(middle > 0.1) & (middle < 0.6)].mean() == pytest.approx(300.0, rel=0.01)
    assert float(archive["contact_time"].squeeze()) == pytest.approx(2 / 3, abs=0.025 / 3)
    assert 10 - impulse[-1] / 10 == pytest.approx(-10.0, abs=0.3)  # the tip loses the energy of half a cell


def test_an_impact_on_a_casing_that_slides(tmp_path: Path) -> None:
    """p = (1 + e) u / nᵀM⁻¹(n - µt), with M⁻¹ of [[1, m], [m, 1]]; -e u at once, whatever µ."""
    archive = truth("sliding_impact", tmp_path)
    exact = 1.6 * 2 * (1 - 0.4**2) / (1 + 0.4 * archive["coefficient"].values)
    impulse = archive["contact_impulse"].transpose("scheme", "h", "coefficient", ...).values.reshape(2, 2, 3)
    np.testing.assert_allclose(impulse[0], np.broadcast_to(exact, (2, 3)), rtol=1e-13)
    apart = np.abs(impulse[1] / exact - 1)
    assert apart.max() < 1e-8


def test_a_mass_pressed_on_a_casing_that_slides(tmp_path: Path) -> None:
    archive = truth("sliding_rest", tmp_path)
    exact = (5 - 1.0 + 0.09) / (1 - 0.3 * archive["coefficient"].values)
    np.testing.assert_allclose(archive["displacement"].values, 0.01, rtol=1e-14)
    impulse = archive["contact_impulse"].transpose("scheme", "coefficient", ...).values.reshape(2, 3)
    np.testing.assert_allclose(impulse, np.broadcast_to(2 * exact, (2, 3)), rtol=1e-12)


def test_siconos_step_by_step(tmp_path: Path) -> None:
    archive = truth("siconos_chain", tmp_path)
    for k, file in enumerate(("theta1_e0", "theta0.5_e0.8")):
        with np.load(ROOT / "tests" / "data" / f"siconos_{file}.npz") as siconos:
            for name in ("displacement", "velocity"):
                ours = archive[name].isel(law=k).values.ravel()
                assert np.abs(ours - siconos[name]).max() <= 1e-9 * np.abs(siconos[name]).max()
