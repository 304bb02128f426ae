"""A casing that wears: what the guide writes, and the study that ships."""

import re
from pathlib import Path

import numpy as np
import pytest

from scripts import STUDIES
from workflow import run_study

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
