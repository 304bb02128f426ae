"""An elastic casing: exact in closed form, the limit of a contact spring, and the same through a study."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenes import cases, chain, movable, sampling, step
from workflow import run_study
from workflow.archive import open_archive
from workflow.models import at_rest
from workflow.study import Study, StudyError, read_study

CASING = 2e-5


@pytest.mark.parametrize("integration", ["explicit", "implicit"])
def test_a_contact_spring_converges_to_it(integration: str) -> None:
    """Second order, but for where in a step contacts begin and end: over an eightfold step 1.5 at least."""
    heat = {"heat_capacity": 5.0, "expansion": 1e-3, "spacing": 0.1, "conductance": 0.5, "convection": 0.1}
    rod, over = chain(nodes=3, mass=0.1, stiffness=4000.0, **heat), sampling(0.5, 1e-3)
    batch = cases(rod, alpha=0.5, gap=1e-3, amplitude=4.0, frequency=12.0)
    exact = step(rod.on_casing(CASING), batch, 1.0, over, "event_driven").histories
    assert exact["temperature"].max() > 0.01

    def error(h: float) -> float:
        own = step(rod, batch, h, over, "penalty", stiffness=1 / CASING, integration=integration, theta=0.5)
        names = ("displacement", "impulse", "temperature")
        return max(float(np.abs(own.histories[name] - exact[name]).max() / np.abs(exact[name]).max()) for name in names)

    coarse, fine = error(2e-5), error(2.5e-6)
    assert fine < 5e-6
    assert np.log(coarse / fine) / np.log(8) > 1.25


def test_a_static_start_rests_on_it() -> None:
    """x = (f + d/c)/(k + 1/c) of a single mass, and it stays there."""
    k, c, f, d = 4000.0, 2e-4, 9.0, 1e-3
    mass = chain(nodes=1, mass=0.1, stiffness=k).on_casing(c)
    resting = at_rest(mass, movable(cases(mass, gap=d, mean=f)))
    np.testing.assert_allclose(resting.displacement, (f + d / c) / (k + 1 / c), rtol=1e-13)
    for method in ("event_driven", "moreau"):
        done = step(mass, resting, 1e-4, sampling(0.1, 0.01), method)
        np.testing.assert_allclose(done.histories["displacement"][0], resting.displacement[0, 0], rtol=1e-11)
        np.testing.assert_allclose(
            done.histories["impulse"][0, -1], 0.1 * (resting.displacement[0, 0] - d) / c, rtol=1e-9
        )


STUDY: dict[str, Any] = {
    "study": "elastic",
    "scene": {
        "chain": {"nodes": 3, "mass": 0.1, "stiffness": 4000, "heat_capacity": 5},
        "casing": {"gap": 1e-3, "harmonics": [{"frequency": 31, "amplitude": 0}]},  # by a kernel of other tests
        "load": {"amplitude": 4, "frequency": 12},
        "duration": 0.2,
    },
    "schemes": {
        "exact": {"method": "event_driven"},
        "moreau": {"method": "moreau", "theta": 0.5},
        "carpenter": {"method": "carpenter"},
    },
    "axes": {"scheme": ["exact", "moreau"], "alpha": 0, "e": 0, "h": 1e-5, "scene.casing.flexibility": [0, 1e-5, 2e-5]},
    "output": {"interval": 1e-3},
}


def study(**axes: Any) -> Study:
    return read_study(STUDY | {"axes": STUDY["axes"] | axes})


def test_its_flexibility_is_an_axis(tmp_path: Path) -> None:
    run_study(study(), tmp_path / "a", threads=1)
    with open_archive(tmp_path / "a") as archive:
        assert (archive["status"] == 0).all()
        deep = archive["max_penetration"].sel(scheme="exact").squeeze().values
        assert deep[0] < 1e-15 < 1e-6 < deep[1] < deep[2]
        apart = archive["displacement"].sel(scheme="moreau") - archive["displacement"].sel(scheme="exact")
        assert float(abs(apart).max()) < 0.02 * float(abs(archive["displacement"]).max())


def test_other_schemes_refuse_it() -> None:
    with pytest.raises(StudyError, match=r"carpenter.*rigid casing"):
        study(scheme=["exact", "carpenter"])
