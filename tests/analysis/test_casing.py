"""The casing's motion, read from an archive."""

import numpy as np
import pytest
import xarray as xr

from workflow.analysis import casing_motion, period_frequency


def case(attrs: dict, **coords: tuple) -> xr.Dataset:
    t = np.linspace(0, 1, 2001)
    dataset = xr.Dataset(coords={"t": t, "gap": ((), 1e-5, attrs)})
    return dataset.assign_coords({name: ((), value, {"study_path": path}) for name, (value, path) in coords.items()})


ENTRIES = [
    {"amplitude": 2e-6, "phase": 0.5, "frequency": None, "order": 3.0},
    {"amplitude": 1e-6, "phase": 0.0, "frequency": 7.0, "order": None},
]


def attributes(entries: list[dict]) -> dict:
    """What the coordinate ``gap`` of an archive says of the casing's harmonics."""
    return {f"casing_{name}": [np.nan if e[name] is None else e[name] for e in entries] for name in entries[0]}


def test_axes_replace_what_the_study_gives() -> None:
    motion = casing_motion(
        case(
            {**attributes(ENTRIES), "speed": 2.0},
            speed=(5.0, "scene.speed"),
            harmonic_amplitude=(4e-6, "scene.casing.harmonics.0.amplitude"),
        )
    )
    assert motion is not None
    t = np.linspace(0, 1, 2001)
    place = 1e-5 + 4e-6 * np.sin(2 * np.pi * 15 * t + 0.5) + 1e-6 * np.sin(2 * np.pi * 7 * t)
    assert np.abs(motion[0] - place).max() < 1e-19  # roundings of 1e-5
    assert np.abs(motion[1] - np.gradient(place, t))[1:-1].max() < 1e-3 * np.abs(motion[1]).max()


@pytest.mark.parametrize(
    "wrong", [{}, {"casing_phase": "none"}, {"casing_phase": [0.0]}, {"casing_amplitude": None}, {"speed": "fast"}]
)
def test_what_makes_no_sense_does_not_move(wrong: dict) -> None:
    assert casing_motion(case({**attributes(ENTRIES), "speed": 2.0, **wrong} if wrong else {})) is None


@pytest.mark.parametrize(
    ("amplitude", "load", "casing", "frequency"),
    [(2.0, [], ENTRIES, 50.0), (0.0, [], ENTRIES, 15.0), (0.0, ENTRIES[1:], ENTRIES, 7.0), (0.0, [], [], 50.0)],
)
def test_periods_are_those_of_the_load_else_of_the_first_harmonic(
    amplitude: float, load: list, casing: list, frequency: float
) -> None:
    scene = {
        "speed": 2.0,
        "load": {"amplitude": 1.0, "frequency": 50.0, "harmonics": load},
        "casing": {"harmonics": casing},
    }
    one = case({}, speed=(5.0, "scene.speed"), amplitude=(amplitude, "scene.load.amplitude"))
    assert period_frequency(one, scene) == frequency


@pytest.mark.parametrize("scene", [{}, {"load": 1}, {"load": {"amplitude": 0, "harmonics": [2]}}])
def test_a_scene_without_sense_has_no_periods(scene: dict) -> None:
    assert np.isnan(period_frequency(case({}), scene))
