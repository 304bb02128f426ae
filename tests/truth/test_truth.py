"""The page of truth: each of its numbers anew, and what fixed steps make of its scenes."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from scripts import STUDIES
from workflow import read_study, run_study
from workflow.models._matrix_files import read_entries
from workflow.schemes import Status

sys.path.insert(0, str(STUDIES / "truth"))

import comparison
import structures
import truth_page

LONG = {
    "One impact in n load periods, over the gap",
    "Grazing and doubling of a heated mass",
    "A mass on an elastic-plastic stop (a coating)",
}
SECTIONS = {text.split("\n", 1)[0]: text for text in truth_page.PAGE.read_text(encoding="utf-8").split("\n### ")[1:]}
SCENES = [
    pytest.param(each, id=each.title, marks=[pytest.mark.slow] if each.title in LONG else [])
    for each in truth_page.COMPARISONS
]


def written(title: str) -> list[tuple[str, float, float]]:
    """Return what the page says in a section: quantity, what is known and what this program gives."""
    rows = re.findall(r"^\| (.*?) \| (\S+) \| (\S+) \|", SECTIONS[title], re.MULTILINE)
    return [(what, float(known), float(here)) for what, known, here in rows if what != "what"]


def test_the_page_has_every_scene() -> None:
    topics = list(truth_page.TOPICS)
    ordered = sorted(truth_page.COMPARISONS, key=lambda each: topics.index(each.topic))
    assert list(SECTIONS) == [each.title for each in ordered]
    linked = {study for each in truth_page.COMPARISONS for study in each.studies}
    assert {f"truth/{path.stem}" for path in truth_page.TRUTH.glob("*.yaml")} <= linked


@pytest.mark.parametrize("name", structures.FILES)
def test_the_files_of_matrices_are_what_the_script_writes(name: str) -> None:
    stored, computed = read_entries(STUDIES / "truth" / f"{name}.npz"), structures.FILES[name]()
    assert set(stored) == set(computed)
    for entry, matrix in computed.items():
        entries = stored[entry].toarray() if hasattr(stored[entry], "toarray") else np.asarray(stored[entry])
        np.testing.assert_allclose(entries.reshape(matrix.shape), matrix, rtol=0, atol=1e-14 * abs(matrix).max())


@pytest.mark.parametrize("each", SCENES)
def test_every_number_of_the_page(each: comparison.Comparison) -> None:
    """Today's agrees with what is known, and the page, which ``python studies/truth/truth_page.py`` writes, says so."""
    rows = each.rows()
    assert [row for row in rows if not row.agrees] == []
    page = written(each.title)
    assert [what for what, _, _ in page] == [row.what for row in rows]
    for row, (_, known, here) in zip(rows, page, strict=True):
        assert known == pytest.approx(row.known, rel=1e-9)
        assert here == pytest.approx(row.here, rel=1e-9, abs=2 * row.allowed)


def test_beside_its_doubling_deviations_die_below_and_grow_above() -> None:
    impulse = comparison.solved("truth/period_doubling")["period_impulse"].transpose("frequency", "period", ...)
    changes = np.diff(impulse.values.reshape(3, -1), axis=1)
    below, _, above = changes[:, -1] / changes[:, -2]
    assert above < -1.005 < -0.995 < below


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
    name: str, period: float, impulse: float, impacts: int, largest: tuple[float, float]
) -> None:
    """Mean impulse of the last third of the periods: of θ = 1 to the first order, of θ = 1/2 far closer.

    Impacts are in contact for one step each.
    """
    errors = []
    for steps in (250, 1000):
        h = period / steps
        archive = comparison.solved(
            f"truth/{name}",
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


AUDIT = Path(__file__).parent / "audit"


def solved(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    study = read_study(AUDIT / f"{name}.yaml").with_(settings)
    return run_study(study, tmp_path / "x.nc", threads=1).dataset.load()


@pytest.mark.parametrize("alpha", [6e4, 7e4, 7.4e4, 8e4, 8.2e4])
def test_a_state_that_leaves_the_numbers_ends_its_case(alpha: float, tmp_path: Path) -> None:
    """Growth rate times duration is 943 at 8e4: the exponential overflows, at last or before the bounds of a step."""
    archive = solved("never_ends", tmp_path, **{"axes.alpha": alpha})
    assert int(archive["status"]) == int(Status.DIVERGED)
    assert int(archive["runaway"]) == 1
    assert "left the finite numbers" in str(archive["message"].values)


def test_heat_on_a_temperature_without_heat_capacity_pushes_the_structure(tmp_path: Path) -> None:
    impulse = solved("heated_without_capacity", tmp_path)["contact_impulse"].squeeze()
    assert float(impulse.sel(scheme="moreau")) == pytest.approx(float(impulse.sel(scheme="event_driven")), rel=0.02)


GUIDE = (STUDIES / "GUIDE.md").read_text(encoding="utf-8")


def test_the_guide_s_casing_is_worn_by_archard_s_law(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A free mass of two, of which one meets the casing at 3 m/s: it wears κ m v (1 - exp(-t/(κ (m + casing))))."""
    monkeypatch.chdir(tmp_path)
    given = {"M": np.diag([2.0, 5.0]), "K1": np.zeros((2, 2)), "C1": np.zeros((2, 2)), "w": np.array([1.0, 0.0])}
    exec(re.findall(r"```python\n(.*?)```", GUIDE.split("## Wear")[1], re.DOTALL)[0], given)
    scene = {"matrices": {"file": "worn.npz"}, "casing": {"gap": 0}, "initial": {"velocity": [3, 0, 0]}}
    study = {
        "study": "worn",
        "scene": {**scene, "duration": 4e-6},
        "axes": {"scheme": "event_driven", "e": 0},
        "output": {"interval": 1e-6, "sensors": {"worn": "WORN"}},
    }
    found = run_study(study, "worn.nc", threads=1).dataset.load().squeeze()
    wear, casing = given["wear"], given["casing"]
    known = wear * 2 * 3 * -np.expm1(-found["t"] / (wear * (2 + casing)))
    np.testing.assert_allclose(found["sensor_value"].squeeze(), known, rtol=1e-9, atol=1e-18)
    assert float(found["contact_impulse"]) * wear == pytest.approx(float(known[-1]), rel=1e-9)
