"""A casing's profile in a file stands for its gap and harmonics by order."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies import refusal
from workflow.archive import grid_of, provenance
from workflow.cases import arrange, case_hashes
from workflow.models import Array, UnusableMatricesError
from workflow.run import run_study
from workflow.study import Study, read_study, resolved_values
from workflow.study.profile import MOST_ORDERS, harmonics_of

ANGLES = np.arange(0, 360, 5.0)
HARMONICS = [{"order": 2, "amplitude": 4e-6, "phase": 0.3}, {"order": 5, "amplitude": 1.5e-6, "phase": -1.2}]


def gaps(angles: Array, harmonics: list[dict[str, Any]], mean: float = 2e-5) -> Array:
    waves = (one["amplitude"] * np.sin(one["order"] * np.radians(angles) + one["phase"]) for one in harmonics)
    return np.asarray(mean + sum(waves))


def written(place: Path, angles: Array, gap: Array, name: str = "profile.csv") -> None:
    rows = "\n".join(f"{a!r},{d!r}" for a, d in zip(angles.tolist(), gap.tolist(), strict=True))
    (place / name).write_text(f"angle [deg],gap [m]\n{rows}\n")


def study(place: Path, casing: dict[str, Any], speed: float | None = 60) -> Study:
    chain = {"nodes": 3, "mass": 2.5e-3, "stiffness": 2e6, "spacing": 2.5e-3, "damping": {"mass": 10}}
    chain |= {"expansion": 8.6e-6, "heat_capacity": 1.3, "conductance": 0.6}
    scene = {"chain": chain, "casing": casing, "duration": 0.02, "load": {"amplitude": 30, "frequency": 200}}
    scene |= {} if speed is None else {"speed": speed}
    axes = {"scheme": "event_driven", "alpha": 10}
    (place / "study.yaml").write_text(json.dumps({"study": "oval", "scene": scene, "axes": axes}))
    return read_study(place / "study.yaml")


def test_a_profile_is_its_harmonics(tmp_path: Path) -> None:
    """Written by hand they give the same archive; the profile travels with its archive and is part of the identity."""
    written(tmp_path, ANGLES, gaps(ANGLES, HARMONICS))
    profiled = study(tmp_path, {"profile": "profile.csv", "clearance": 1e-6})
    assert profiled.scene.casing.gap == 2e-5
    found = profiled.scene.casing.harmonics
    assert [{name: getattr(one, name) for name in ("order", "amplitude", "phase")} for one in found] == HARMONICS
    by_hand = study(tmp_path, {"gap": 2e-5, "harmonics": HARMONICS, "clearance": 1e-6})
    runs = [run_study(one, tmp_path / f"{k}.nc", threads=1).dataset.load() for k, one in enumerate((profiled, by_hand))]
    assert (runs[0]["contact_impulse"] > 0).all()
    for name in ("displacement", "temperature", "contact_force", "contact_impulse", "gap"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=1e-12, atol=0)
    hashes = [case_hashes(arrange(one)).tolist() for one in (profiled, by_hand)]
    assert hashes[0] != hashes[1]
    (tmp_path / "profile.csv").unlink()
    assert case_hashes(grid_of(provenance(tmp_path / "0.nc"))).tolist() == hashes[0]


def test_a_change_of_the_profile_changes_the_hash(tmp_path: Path) -> None:
    """Also one that the harmonics do not follow."""
    gap = gaps(ANGLES, HARMONICS)
    digests = set[bytes]()
    for change in (0.0, 1e-13, 1e-12):
        written(tmp_path, ANGLES, gap + change * np.cos(36 * np.radians(ANGLES)))
        digests.add(case_hashes(arrange(study(tmp_path, {"profile": "profile.csv"}))).tobytes())
    assert len(digests) == 3


def test_a_plan_shows_what_a_profile_comes_to(tmp_path: Path) -> None:
    written(tmp_path, ANGLES, gaps(ANGLES, HARMONICS))
    waves = {"amplitude": 1e-6, "frequency": 7}
    profiled = study(tmp_path, {"profile": "profile.csv", "harmonics": [waves]})
    resolved = {one.path: (one.values, one.origin) for one in resolved_values(profiled, arrange(profiled).settings(0))}
    assert resolved["scene.casing.profile"] == (("profile.csv",), "study")
    assert resolved["scene.casing.gap"] == ((2e-5,), "study")
    assert resolved["scene.casing.harmonics.0.frequency"] == ((7.0,), "study")
    assert resolved["scene.casing.harmonics.2.order"] == ((5.0,), "study")
    assert len(profiled.resolved()["scene"]["casing"]["profile"]["sha256"]) == 64


@given(
    st.dictionaries(st.integers(1, 35), st.tuples(st.floats(0.05, 1), st.floats(-3.1, 3.1)), min_size=1, max_size=12),
    st.floats(-30, 30),
    st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_a_sum_of_orders_gives_these_orders(waves: dict[int, tuple[float, float]], first: float, closed: bool) -> None:
    """From any first angle, with the first place again at the end or without it."""
    angles = first + np.arange(0, 361 if closed else 360, 5.0)
    harmonics = [{"order": k, "amplitude": 1e-6 * a, "phase": p} for k, (a, p) in sorted(waves.items())]
    mean, found = harmonics_of(angles, gaps(angles, harmonics))
    assert mean == pytest.approx(2e-5, rel=1e-10)
    assert [one.order for one in found] == sorted(waves)
    assert [one.amplitude for one in found] == pytest.approx([one["amplitude"] for one in harmonics], rel=1e-7)
    turned = np.exp(1j * np.array([one.phase for one in found]))
    np.testing.assert_allclose(turned, np.exp(1j * np.array([p for _, (_, p) in sorted(waves.items())])), atol=1e-7)


@given(st.integers(0, 2**32), st.integers(3, 200))
@settings(max_examples=60, deadline=None)
def test_harmonics_follow_any_profile_or_it_is_refused(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.linspace(0, 360, count, endpoint=False)
    gap = 2e-5 + 1e-6 * np.cumsum(rng.normal(size=count)) * rng.choice([1e-3, 1])
    gap -= (gap[-1] - gap[0]) * angles / 360
    try:
        mean, found = harmonics_of(angles, gap)
    except UnusableMatricesError:
        assert count % 2 == 0 or count > 2 * MOST_ORDERS
        return
    waves = [{"order": one.order, "amplitude": one.amplitude, "phase": one.phase} for one in found]
    assert len(found) <= MOST_ORDERS
    assert np.abs(gaps(angles, waves, mean) - gap).max() <= 1e-3 * np.ptp(gap) + 1.001e-11 * abs(mean)


def test_a_constant_profile_has_no_harmonics() -> None:
    for gap in (3e-5, -2.12345678901234567e-5):
        mean, found = harmonics_of(ANGLES, np.full(ANGLES.size, gap))
        assert mean == pytest.approx(gap, rel=1e-11)
        assert found == ()


ROUND = gaps(ANGLES, HARMONICS)
UNEVEN = np.where(ANGLES > 100, ANGLES + 1.0, ANGLES)
FINE = np.arange(0, 360, 0.5)
REFUSED: dict[str, tuple[Array, Array, dict[str, Any], str]] = {
    "a gap beside it": (ANGLES, ROUND, {"gap": 1e-5}, "profile: stands beside `gap`, which it replaces; keep one"),
    "an order": (ANGLES, ROUND, {"harmonics": HARMONICS[:1]}, "profile: stands beside harmonics by `order`"),
    "uneven": (UNEVEN, ROUND, {}, "the profile has 72 angles, and 106 deg is not a multiple of 5 deg from"),
    "half a turn": (ANGLES / 2, ROUND, {}, "and 2.5 deg is not a multiple of 5 deg from"),
    "too few": (np.array([0.0, 180.0]), np.ones(2), {}, "the profile has 2 angles"),
    "a step": (np.linspace(0, 360, 73), np.linspace(1e-5, 2e-5, 73), {}, "1e-05 m at 0 deg and 2e-05 m"),
    "a rough one": (FINE, np.sign(np.sin(np.radians(FINE + 0.1))) * 1e-6, {}, "32 orders leave 0.41 of the range"),
    "no gap": (ANGLES, 1e308 * np.cos(np.pi * np.arange(72)), {}, "a gap or an angle of more than 1e6"),
    "too coarse a one": (ANGLES[::18], np.array([0, 1e-6, 0, 1e-6]), {}, "1 orders leave 0.5 of the range"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_no_profile_is_refused(name: str, tmp_path: Path) -> None:
    angles, gap, more, said = REFUSED[name]
    written(tmp_path, angles, gap)
    assert said in refusal(study, tmp_path, {"profile": "profile.csv", **more})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("angle [rad],gap [m]\n0,1\n", "has `angle` in rad; write `angle [deg]`"),
        ("angle,gap [mm]\n0,1\n", "has `gap` in mm; write `gap [m]`"),
        ("angle,clearance\n0,1\n", "has the columns angle,clearance; write angle, gap"),
        ("angle,gap\n0,1\n5,x\n", "line 3: `5,x` is not 2 numbers"),
    ],
)
def test_what_is_no_file_of_one_is_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "profile.csv").write_text(text)
    assert re.search(f"scene.casing.profile: .*{re.escape(said)}", refusal(study, tmp_path, {"profile": "profile.csv"}))


def test_a_profile_turns_at_a_speed(tmp_path: Path) -> None:
    written(tmp_path, ANGLES, ROUND)
    said = "scene.casing.profile: turns at a speed that is not given; write `speed`"
    assert said in refusal(study, tmp_path, {"profile": "profile.csv"}, speed=None)
    assert re.search("gap: is missing; write it: .*or `profile`", refusal(study, tmp_path, {"clearance": 1e-6}))
