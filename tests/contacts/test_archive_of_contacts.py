"""From a study with several contacts to its archive: shapes, casing, errors, what reads it, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from scenes_of_contacts import OUTPUT, SCENE, chain, study

from plain_steps import place
from workflow import compare
from workflow.analysis import casing_motion, contact_phases, most_loaded, standings
from workflow.archive import content_hash, open_archive, provenance
from workflow.cases import arrange, case_hashes, full_structure
from workflow.cases._conditions import conditions
from workflow.models import Cases
from workflow.orbits import STATES
from workflow.plots import contacts, histories
from workflow.report import write_report
from workflow.run import run_study
from workflow.run._verify import verify
from workflow.schemes import carpenter, moreau, step_central
from workflow.study import Study, StudyError, read_study
from workflow.variables import BY_NAME

PER_PERIOD = {"period_impulse", "period_force", "period_temperature", "period_contact"}
SECTIONS = {"section_displacement", "section_velocity", "section_temperature", "period_impacts"}
SECTIONS |= {"period_displacement", "period_displacement_min"}
OF_CONTACT = {"contact_impulse", "impacts", "contact_time", "max_penetration", "max_temperature"}


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """Two steps and two clearances against the finest step, with load periods."""
    directory = tmp_path_factory.mktemp("contacts")
    axes = {"h": [1e-4, 2e-4], "scene.casing.clearance": [0, 5e-6], "alpha": 10, "e": 0.2}
    reference = {"scheme": "moreau", "h": 5e-5}
    output = OUTPUT | {"sections": True}
    run_study(study(directory, axes=axes, reference=reference, output=output), directory / "a.nc", threads=1)
    with open_archive(directory / "a.nc") as opened:  # netCDF-C crashes on a file with texts that is open twice
        return opened.load()


def test_contacts_have_a_dimension_before_t_and_period(archive: xr.Dataset) -> None:
    cases = archive["status"].dims
    assert archive["contact"].values.tolist() == ["mid", "end"]
    assert "gap" not in archive.xindexes  # archives of other gaps are compared contact by contact
    for name, values in archive.data_vars.items():
        about = BY_NAME.get(str(name))
        tail = {"history": ("contact", "t"), "period": ("contact", "period")}.get(about.shape if about else "", ())
        tail = ("contact",) if name in OF_CONTACT else tail
        assert values.dims == (*cases, *tail), name
    assert {name for name in archive.data_vars if "period" in archive[name].dims} == PER_PERIOD | SECTIONS
    assert (archive["status"] == 0).all()
    assert "predictability" in archive
    assert "energy_residual" not in archive


def test_what_is_derived_is_that_of_each_contact(archive: xr.Dataset) -> None:
    impulse, force = archive["impulse"], archive["contact_force"]
    assert (archive["contact_impulse"] > 0).all()
    np.testing.assert_array_equal(archive["contact_impulse"], impulse.isel(t=-1))
    np.testing.assert_allclose(force.isel(t=slice(1, None)), impulse.diff("t") / 5e-4, rtol=1e-12)
    np.testing.assert_allclose(archive["period_impulse"].sum("period"), impulse.interp(t=2 / 65), rtol=0.02)
    assert archive["period_force"].max() == pytest.approx(float(force.sel(t=slice(0, 2 / 65)).max()))
    assert (archive["period_displacement"] >= archive["period_displacement_min"]).all()


def test_an_error_is_a_norm_over_contacts_and_samples(archive: xr.Dataset, tmp_path: Path) -> None:
    fine = run_study(
        study(tmp_path, axes={"h": 5e-5, "scene.casing.clearance": [0, 5e-6], "alpha": 10, "e": 0.2}),
        tmp_path / "fine.nc",
        threads=1,
    ).dataset
    for name in ("displacement", "temperature", "impulse"):
        apart, over = archive[name] - fine[name].drop_vars("h"), ["contact", "t"]
        norm = np.sqrt((apart**2).sum(over) / (fine[name] ** 2).sum(over))
        np.testing.assert_allclose(norm.values.ravel(), archive[f"{name}_error"].values.ravel(), rtol=1e-9)
        assert (archive[f"{name}_error"].sel(h=1e-4) < archive[f"{name}_error"].sel(h=2e-4)).all()
    assert (archive["predictability"] < 1e-6).all()
    assert compare(archive, archive)["impulse"].dims[-1] == "contact"


def test_clearance_opens_every_gap(archive: xr.Dataset) -> None:
    assert archive["gap"].values.tolist() == SCENE["casing"]["gap"]
    assert archive["gap"].dims == ("contact",)
    assert archive["contact_angle"].values.tolist() == [0.0, 1.3]
    taken = archive.isel(h=0, clearance=1, contact=1).squeeze()
    motion = casing_motion(taken)
    t = taken["t"].values
    np.testing.assert_allclose(motion[0], 6e-5 + 5e-6 * np.sin(2 * np.pi * 120 * t + 0.2 + 3 * 1.3), rtol=1e-12)
    assert float((taken["displacement"] - motion[0]).max()) < 1e-6


def test_it_is_read_at_the_most_loaded_contact(archive: xr.Dataset) -> None:
    loads = archive["contact_impulse"].max(archive["status"].dims)
    assert most_loaded(archive)["contact"].item() == archive["contact"].values[int(np.argmax(loads.values))] == "end"
    assert contact_phases(archive)["impulse"].dims[-2:] == ("contact", "phase")
    assert len(standings(archive)) == 2
    assert "contact end" in histories(archive).get_suptitle()


@pytest.mark.slow
def test_it_is_verified_and_its_page_names_the_contact(archive: xr.Dataset, tmp_path: Path) -> None:
    path = Path(archive.encoding["source"])
    assert all(check.holds for check in verify(path, 2))
    assert content_hash(path) == provenance(path)["content_hash"]
    page = write_report(path, tmp_path / "page.html").page
    assert "contact end, the most loaded" in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_picture_of_contacts_on_a_page_is_that_of_the_selected_case(tmp_path: Path) -> None:
    """The end of a chain has a wide gap: it takes more than the middle at one of two frequencies."""
    from browser import MODEL, errors, opened, settle, window

    casing = {"casing": {"gap": [3e-5, 9e-5]}}
    given = study(
        tmp_path, scene=casing, axes={"h": 1e-4, "alpha": 1, "scene.load.frequency": [24, 103], "scheme": "moreau"}
    )
    run_study(given, tmp_path / "two.nc", threads=1)
    page, driver = write_report(tmp_path / "two.nc", tmp_path / "two.html").page, window(1366)
    opened(driver, page)
    firsts = []
    with open_archive(tmp_path / "two.nc") as archive:
        for k, text in enumerate(driver.execute_script(MODEL + "return model('slider_frequency').categories")):
            driver.execute_script(MODEL + "model('slider_frequency').value = arguments[0]", text)
            settle(driver)
            case = archive.isel(frequency=k).squeeze()
            order = np.argsort(-case["contact_impulse"].values)
            firsts.append(str(case["contact"].values[order[0]]))
            title = driver.execute_script("return document.getElementById('contacts-title').textContent")
            assert title == f"Force of each contact; most loaded: contact {firsts[-1]}"
            shown = driver.execute_script(MODEL + "return [...model('contact_cells').data.image[0]]")
            force = case["contact_force"].values[order, 1:]
            drawn = np.array([value or 0.0 for value in shown], dtype=float).reshape(force.shape)
            np.testing.assert_allclose(drawn, force, rtol=0, atol=0.003 * force.max())
    assert len(set(firsts)) == 2, firsts
    assert not errors(driver)


def cases_of(study: Study) -> Cases:
    grid = arrange(study)
    settings, inner = grid.settings(0), np.arange(grid.inner_count)
    return conditions(settings, full_structure(settings), grid.inner_values(inner), inner.size)


def test_gaps_and_turns_are_those_of_each_contact(tmp_path: Path) -> None:
    scene = {"casing": SCENE["casing"] | {"clearance": 1e-6, "angles": ["90 deg", 0.5]}}
    scene["casing"]["harmonics"] = [*SCENE["casing"]["harmonics"], {"frequency": 7, "amplitude": 1e-6, "phase": 0.1}]
    cases = cases_of(read_study(study(tmp_path, scene=scene, axes={"scene.casing.harmonics.0.order": [1, 2]})))
    assert cases.contact_shape == (2,)
    np.testing.assert_allclose(cases.gaps, [[3.1e-5, 5.6e-5]] * 2, rtol=1e-15)
    np.testing.assert_allclose(cases.turns[..., 0], [[np.pi / 2, 0.5], [np.pi, 1.0]], rtol=1e-15)
    assert not cases.turns[..., 1].any()
    apart = np.subtract(*(place(cases.take(slice(1, 2)), t) for t in (0.01, 0.01 + 1e-9)))
    assert apart[0] != apart[1]


def test_a_case_is_known_by_gaps_clearance_and_turns(tmp_path: Path) -> None:
    def first(**casing: Any) -> bytes:
        scene = {"casing": SCENE["casing"] | casing}
        return case_hashes(arrange(read_study(study(tmp_path, scene=scene))))[0].tobytes()

    usual = first()
    assert usual == first(clearance=0) == first(gap=[0, 2.5e-5], clearance=3e-5)
    changed = [{"gap": [3e-5, 6e-5]}, {"gap": 3e-5}, {"clearance": 1e-6}, {"angles": [0, 1]}]
    assert len({usual, *(first(**one) for one in changed)}) == 5


def test_a_list_of_one_is_one_contact(tmp_path: Path) -> None:
    entries = chain()
    one = entries | {"contact": entries["contact"][1], "thermal_contact": entries["thermal_contact"][1]}
    file = tmp_path / "one.npz"
    np.savez(file, **{k: v for k, v in one.items() if k not in ("contact_labels", "angle")})

    def read(**casing: Any) -> Study:
        scene = {"matrices": {"file": str(file)}, **SCENE, "casing": casing}
        return read_study({"study": "one", "scene": scene, "axes": {"scheme": "moreau"}})

    assert read(gap=[5e-5]).scene == read(gap=5e-5).scene
    assert read(gap=5e-5).contacts == ()
    np.testing.assert_array_equal(cases_of(read(gap=5e-5, clearance=1e-5)).gaps, 6e-5)
    harmonics = [{"order": 2, "amplitude": 1e-6, "phase": 0.1}, {"frequency": 3, "amplitude": 1e-6}]
    turned = cases_of(read(gap=5e-5, harmonics=harmonics, angles=[0.4]))
    np.testing.assert_allclose(turned.casing_harmonics.phase + turned.turns[:, 0], [[0.9, 0.0]])
    with pytest.raises(StudyError, match=r"casing.gap: has 2 values where the model has 1 contact"):
        read(gap=[5e-5, 6e-5])
    with pytest.raises(StudyError, match=r"casing.angles: has 2 values where the model has 1 contact"):
        read(gap=5e-5, angles=[0.1, 0.2])


REFUSED = {
    "three gaps": ({"scene": {"casing": {"gap": [1e-5] * 3}}}, "gap: has 3 values where the model has 2 contacts"),
    "one angle": ({"scene": {"casing": {"gap": 1e-5, "angles": [0.1]}}}, "casing.angles: has 1 values"),
    "a list as an axis": ({"axes": {"scene.casing.gap": [[1e-5, 2e-5]]}}, "an axis has single values"),
    "inside": (
        {"scene": {"initial": {"displacement": [0, 0, 4e-5, 0, 0]}}},
        "contact `mid` starts inside the casing, at 4e-05 m with a gap of 3e-05 m",
    ),
    "inside by an angle": (
        {"scene": {"casing": SCENE["casing"] | {"gap": 3e-6, "harmonics": [{"order": 1, "amplitude": 5e-6}],
                                                "angles": [0.0, -1.5]}}},
        "contact `end` starts inside the casing",
    ),
    "a scheme of one": ({"axes": {"scheme": ["moreau", "carpenter"]}}, "`carpenter` takes one contact"),
    "its reference": ({"reference": {"scheme": "carpenter"}}, "reference.scheme: `carpenter` takes one contact"),
    "too many modes": (
        {"reference": {"scheme": "moreau", "mechanical_modes": 5}},
        "reference.mechanical_modes: 5 is more than the 3 interior modes, and the structure has 2 contacts",
    ),
    "a basis with mass": (
        {
            "entries": chain() | {"residual_flexibility": 1e-9 * np.eye(2)},
            "axes": {"reduction": ["macneal", "krylov"], "mechanical_modes": 2},
        },
        "axes.reduction: `krylov` takes one contact with mass, and the structure has 2 contacts",
    ),
    "other contacts along an axis": (
        {"axes": {"scene.matrices.contact": ["contact", "mid"]}},
        "axes.scene.matrices.contact: has other contacts at its end",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_of_one_contact_is_refused_in_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(carpenter, "compute", lambda *given: step_central(*given))  # it does not say how many it takes
    monkeypatch.setattr(carpenter, "GENERAL", carpenter.GENERAL - {"contacts"})
    changed, said = REFUSED[name]
    with pytest.raises(StudyError) as refused:
        read_study(study(tmp_path, **changed))
    assert any(said in str(mistake) for mistake in refused.value.mistakes), refused.value


def test_steady_rubs_and_branches_have_the_contacts(tmp_path: Path) -> None:
    """Impulses of each are those of the last periods of the transient; the settling time is of the whole."""
    scene: dict[str, Any] = {"scene": {"duration": 4.0, "load": SCENE["load"] | {"frequency": 60.0}, "speed": 20.0}}
    axes: dict[str, Any] = {"scheme": "event_driven", "e": 0.2}
    output = {"interval": 1e-2, "histories": ["displacement"], "steady": {"samples": 6}, "sensors": {"second": 2}}
    entries = chain(heated=False)
    run_study(study(tmp_path, entries, **scene, axes=axes, output=output), tmp_path / "a.nc", threads=1)
    archive = open_archive(tmp_path / "a.nc")
    assert archive["steady_state"].item() == STATES.index("settles")
    assert archive["orbit_displacement"].dims[-2:] == ("contact", "phase")
    assert archive["orbit_sensor"].dims[-2:] == ("sensor", "phase")
    assert archive["settling_time"].size == 1
    last = archive["period_impulse"].isel(period=slice(-int(archive["steady_periods"].item()), None)).mean("period")
    np.testing.assert_allclose(archive["steady_impulse"].squeeze(), last.squeeze(), rtol=1e-6)
    axes["scene.load.amplitude"] = {"branch": [28.0, 30.0, 3]}
    run_study(study(tmp_path, entries, **scene, axes=axes, output=output), tmp_path / "b.nc", threads=1)
    archive = open_archive(tmp_path / "b.nc")
    assert archive["steady_impulse"].dims[-2:] == ("contact", "point")
    assert archive["orbit_displacement"].dims[-3:] == ("contact", "point", "phase")
    assert (archive["steady_impulse"].isel(point=0) > 0).any()
    assert write_report(tmp_path / "b.nc", tmp_path / "b.html").page.exists()


def test_a_load_without_a_direction_is_refused(tmp_path: Path) -> None:
    entries = {name: entry for name, entry in chain().items() if name != "load"}
    with pytest.raises(StudyError, match=r"scene.load: has no direction.*entry `load`"):
        read_study(study(tmp_path, entries))
    read_study(study(tmp_path, entries, scene={"load": {"steady": 1.0}}))


def test_a_scheme_that_lacks_a_contact_fails_with_a_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = moreau.compute

    def lacking(*given: Any) -> Any:
        results = whole(*given)
        results.metrics["impacts"] = results.metrics["impacts"][:, 0]
        return results

    monkeypatch.setattr(moreau, "compute", lacking)
    outcome = run_study(study(tmp_path), tmp_path / "b.nc", threads=1)
    assert outcome.counts == {"failed": 1}
    assert "`impacts` the shape (1,) where it is (1, 2)" in outcome.dataset["message"].item()


def test_a_picture_of_contacts_has_the_most_loaded_first(archive: xr.Dataset) -> None:
    case = archive.isel(h=0, clearance=0).squeeze()
    impulse = case["contact_impulse"].values
    first = str(case["contact"].values[impulse.argmax()])
    figure = contacts(case)
    panel = figure.axes[0]
    assert panel.get_yticklabels()[0].get_text() == first
    assert figure.get_suptitle().endswith(f"contact {first}")
    drawn = panel.collections[0].get_array()
    steps = np.diff(case["t"].values)
    np.testing.assert_allclose((drawn.filled(0.0) * steps).sum(axis=1), np.sort(impulse)[::-1], rtol=1e-9)
    with pytest.raises(ValueError, match="one contact"):
        contacts(case.isel(contact=0))


def test_sensors_at_contacts_show_their_displacements_and_events_name_them(tmp_path: Path) -> None:
    entries = chain() | {"labels": np.array([f"{k}.y" for k in range(5)]), "gauge": np.array([0, -1.0, 1, 0, 0])}
    axes = {"scheme": ["event_driven", "moreau"], "e": 0.5, "alpha": 3, "h": 2e-5}
    axes |= {"reduction": ["craig_bampton", "macneal"], "mechanical_modes": 2, "thermal_modes": 2}
    sensors = {"mid": "mid", "end": "4.y", "before": "1.y", "gauge": "gauge", "hot": {"temperature": 4}}
    output = {"interval": 5e-4, "sensors": sensors, "events": 40}
    data = run_study(study(tmp_path, entries, axes=axes, output=output), tmp_path / "two.nc").dataset
    assert not data.status.any()
    largest = float(np.abs(data.displacement).max())
    for k, name in enumerate(("mid", "end")):
        assert np.abs(data.sensor_value.sel(sensor=name) - data.displacement.isel(contact=k)).max() < 1e-12 * largest
    strained = data.sensor_value.sel(sensor="mid") - data.sensor_value.sel(sensor="before")
    assert np.abs(data.sensor_value.sel(sensor="gauge") - strained).max() < 1e-12 * largest
    hot = data.sensor_value.sel(sensor="hot") - data.temperature.isel(contact=1)
    assert np.abs(hot).max() < 1e-12 * float(data.temperature.max())
    exact = data.sel(scheme="event_driven")
    for reduction, impacts in (("craig_bampton", True), ("macneal", False)):
        one = exact.sel(reduction=reduction)
        struck = [int(((one.event_contact == k) & (one.event_impulse > 0)).sum()) for k in range(2)]
        assert struck == one.impacts.values.tolist()
        assert (sum(struck) > 3) == impacts
        assert int((one.event_kind >= 0).sum()) == int(one.event_count) <= 40
