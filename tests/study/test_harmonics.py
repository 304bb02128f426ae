"""Harmonics of casing and load, the speed they are multiples of, and the friction that makes alpha."""

import numpy as np
import pytest

from workflow import read_study
from workflow.cases import arrange, case_hashes
from workflow.cases._conditions import conditions
from workflow.models import structure_of
from workflow.study import StudyError, parse_study

SCENE = """study: moving
scene:
  chain: {nodes: 2, mass: 1.0, stiffness: 100.0, heat_capacity: 1.0}
  casing: {gap: 1 mm%s}
  load: {amplitude: %s, frequency: 2 Hz%s}
  duration: 1
%s"""

FRICTION = "  friction: {coefficient: 0.2, sliding_speed: 9, heat_share: 1}"


def written(casing: str = "", load: str = "", rest: str = "", amplitude: str = "1") -> str:
    casing, load = (f", harmonics: [{entries}]" if entries else "" for entries in (casing, load))
    return SCENE % (casing, amplitude, load, rest)


@pytest.fixture(autouse=True)
def any_scheme(monkeypatch):
    monkeypatch.setattr("workflow.schemes.Scheme.cannot_take", lambda scheme, load, casing: None)


def cases(study):
    grid = arrange(study)
    cell = grid.settings(0)
    inner = np.arange(grid.inner_count)
    return conditions(cell, structure_of("chain", cell.scene.parameters), grid.inner_values(inner), inner.size)


def test_orders_are_multiples_of_the_speed_whichever_of_them_varies():
    """d(t) = gap + Σ a sin(2π n f_s t + φ), with any number of an entry along its own dimension."""
    text = written(
        "{order: 2, amplitude: 5 um, phase: 90 deg}, {frequency: 3 Hz, amplitude: 1 um}",
        "{amplitude: 2 N, order: 3}",
        "  speed: 600 rpm\naxes:\n  scene.speed: [600 rpm, 20 Hz]\n  scene.casing.harmonics.0.order: [2, 4]",
    )
    study = read_study(text)
    batch = cases(study)
    assert [d.name for d in arrange(study).inner] == ["harmonic_order", "speed"]
    assert np.array_equal(batch.casing_harmonics.frequency[:, 0], [20.0, 40.0, 40.0, 80.0])
    assert np.array_equal(batch.load_harmonics.frequency[:, 1], [30.0, 60.0, 30.0, 60.0])
    t, turn = 0.0123, 2 * np.pi * 0.0123
    d = 1e-3 + 5e-6 * np.cos(20 * turn) + 1e-6 * np.sin(3 * turn)
    velocity = 2 * np.pi * (-20 * 5e-6 * np.sin(20 * turn) + 3e-6 * np.cos(3 * turn))
    assert batch.casing_of_contacts(t)[0][0, 0] == pytest.approx(d, rel=1e-15)  # a few roundings
    assert batch.casing_of_contacts(t)[1][0, 0] == pytest.approx(velocity, rel=1e-13)
    assert batch.load_at(t)[0] == pytest.approx(np.sin(2 * turn) + 2 * np.sin(30 * turn), rel=1e-14)


def test_names_are_numbered_where_they_are_taken():
    axes = "".join(
        f"  scene.{path}.amplitude: [0, 1e-6]\n"
        for path in ("load", "casing.harmonics.0", "casing.harmonics.1", "load.harmonics.1")
    )
    text = written("{order: 1}, {order: 2}", "{order: 1, amplitude: 1}, {order: 2}", f"  speed: 1\naxes:\n{axes}")
    names = [dimension.name for dimension in read_study(text).dimensions]
    numbered = ["harmonic_amplitude_0", "casing_harmonic_amplitude_1", "load_harmonic_amplitude_1"]
    assert names == ["amplitude", *numbered]


@pytest.mark.parametrize(
    ("casing", "load", "rest", "message"),
    [
        ("{amplitude: 1 um}", "", "", r"harmonics\[0\]: has neither `frequency` nor `order`; write one of the two"),
        ("{amplitude: 1 um, order: 1, frequency: 2}", "", "  speed: 1", "has both `frequency` and `order`"),
        ("", "{amplitude: 1, order: 1}", "", r"load\.harmonics\[0\]\.order: is a multiple of a speed that is"),
        ("", "", f"{FRICTION}\naxes: {{alpha: [1, 2]}}", r"f:8: axes\.alpha: stands beside `scene\.friction`"),
    ],
)
def test_mistakes_are_told_where_they_are(casing, load, rest, message):
    with pytest.raises(StudyError, match=message):
        parse_study(written(casing, load, rest), "f")


def test_the_start_is_judged_against_the_casing_at_0():
    start = "  initial: {displacement: 1.004 mm}"
    read_study(written("{frequency: 1, amplitude: 5 um, phase: 90 deg}", rest=start))
    axes = "axes: {scene.casing.harmonics.0.amplitude: [5 um, -5 um]}"
    with pytest.raises(StudyError, match=r"with a gap of 0\.001 m and the casing at 0\.000995 m"):
        read_study(written("{frequency: 1, phase: 90 deg}", rest=f"{start}\n{axes}"))


HARMONICS = "{amplitude: 1, frequency: 3}, {amplitude: 1, frequency: 8}", "{amplitude: 1 um, frequency: 5}"


@pytest.mark.parametrize(
    ("amplitude", "load", "casing", "periods"),
    [
        *(("1", *HARMONICS, 2), ("0", *HARMONICS, 3), ("0", "", "", 2)),
        ("0", "", f"{HARMONICS[1]}, {{amplitude: 1 um, frequency: 9}}", 5),
    ],
)
def test_periods_are_those_of_the_load_then_of_a_load_harmonic_then_of_the_casing(amplitude, load, casing, periods):
    study = read_study(written(casing, load, amplitude=amplitude))
    assert arrange(study).longest_period_count == periods
    assert cases(study).period_frequency == periods


def test_friction_makes_alpha_along_its_dimensions():
    """α = heat_share · coefficient · sliding_speed."""
    axes = "axes:\n  scene.friction.coefficient: [0.1, 0.2]\n  scene.friction.sliding_speed: [10, 20, 40]"
    text = written(rest=f"  friction: {{coefficient: 0.1, sliding_speed: 10, heat_share: 0.5}}\n{axes}")
    study = read_study(text)
    assert np.array_equal(cases(study).alpha, 0.5 * np.outer([0.1, 0.2], [10.0, 20.0, 40.0]).ravel())
    assert arrange(study).settings(0).alpha == 0.5
    assert all(axis.path != "alpha" for axis in study.scalars)


def test_a_case_is_known_by_what_acts_on_it():
    """An order and its frequency, a friction and its alpha have one hash; another amplitude has another."""

    def first(text: str) -> bytes:
        return case_hashes(arrange(read_study(text)))[0].tobytes()

    by_order = first(written("{order: 2, amplitude: 1 um}", rest="  speed: 10"))
    assert by_order == first(written("{frequency: 20, amplitude: 1 um}"))
    assert by_order != first(written("{frequency: 20, amplitude: 2 um}"))
    assert by_order != first(written("", "{frequency: 20, amplitude: 1e-6}"))
    friction = first(written(rest="  friction: {coefficient: 0.5, sliding_speed: 8, heat_share: 0.25}"))
    assert friction == first(written(rest="axes: {alpha: 1}"))


def test_settings_reach_entries_of_harmonics():
    order = "{order: 2, amplitude: 1 um}"
    changed = {"scene.casing.harmonics.0.amplitude": "3 um", "scene.speed": "600 rpm"}
    scene = read_study(written(order, rest="  speed: 1")).with_(changed).scene
    assert (scene.casing.harmonics[0].amplitude, scene.speed) == (3e-6, 10)
    assert read_study(written(order), {"scene.speed": 2}).scene.speed == 2
