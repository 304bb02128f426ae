"""Studies of an abradable coating: what is refused, what an archive holds, how it grows, sweeps, and what is said."""

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_extension import check_extension

from quick import hashes_of
from workflow import plots, read_study, run_study, write_matrices
from workflow.plan import plan_study
from workflow.report._explorer import _cases
from workflow.run import verify
from workflow.study import Study, StudyError

SECTORS = "scene.casing.coating.sectors"
ROD = {
    "nodes": 2, "mass": 2e-3, "stiffness": 4e6, "damping": {"ratio": 0.3}, "heat_capacity": 1.0, "spacing": 5e-3,
    "expansion": 9e-6, "conductance": 1.0,
}  # fmt: skip
COATING = {"yield_force": "2 N", "hardening": 2e5, "sectors": 12}
CASING = {"gap": "5 um", "flexibility": 1e-7, "harmonics": [{"order": 2, "amplitude": "10 um"}]}


def oval(axes: dict[str, Any] | None = None, **parts: Any) -> Study:
    """Return a study of a rod, pressed by 4 N, in an oval casing that turns three times; parts of the scene by name."""
    output = {"interval": "2 ms", **parts.pop("output", {})}
    scene = {"chain": ROD, "casing": CASING | {"coating": COATING}, "speed": 50.0, "load": {"mean": 4.0}, **parts}
    scene = {name: value for name, value in scene.items() if value is not None}
    given = {"scheme": "moreau", "h": 2e-5, "alpha": 0.2, **(axes or {})}
    return read_study({"study": "oval", "scene": {"duration": 0.06, **scene}, "axes": given, "output": output})


def test_the_example_shows_single_contacts(tmp_path: Path) -> None:
    """Its samples lie several times closer than a contact lasts."""
    text = (files("workflow") / "examples" / "coating.yaml").read_text(encoding="utf-8")
    study = read_study(text.replace("[180, 360]", "180"), {"scene.duration": "50 ms"})
    force = run_study(study, tmp_path / "coating.nc", threads=1).dataset["contact_force"].values
    edges = np.flatnonzero(np.diff((force > 0).astype(int)))
    assert np.mean(edges[1::2] - edges[::2]) > 4


UNCOATED, RIGID = CASING, {"gap": 0.0, "coating": COATING}


@pytest.mark.parametrize(
    ("changed", "problem", "remedy"),
    [
        ({"casing": RIGID}, "coating: lies on a rigid casing", "write `flexibility` beside it"),
        ({"casing": CASING | {"coating": {"yield_force": 0}}}, "yield_force: `0` is out of range", "above 0 N"),
        ({"casing": CASING | {"coating": {"sectors": 3}}}, "yield_force: is missing", "write it: contact force"),
        ({"casing": CASING | {"coating": COATING | {"sectors": 10**9}}}, "out of range", "at most 36000"),
        ({"speed": None}, "sectors: are of a casing that does not turn", "`speed: 9000 rpm`, or `sectors: 1`"),
        ({"axes": {"scheme": "penalty"}}, "takes a casing without `coating`", "write event_driven or moreau"),
        ({"output": {"steady": True}}, "steady: takes a casing without `coating`", "or the coating"),
        ({"output": {"wear": {"every": 4}}}, "maps every 4 revolutions of a case that has 3", "write fewer"),
        ({"output": {"wear": {"every": 1}}, "casing": UNCOATED}, "maps a coating, and", "or write `coating`"),
        ({"axes": {"scene.load.mean": {"branch": [1, 2, 3]}}}, "takes a casing without `coating`", "write a list"),
        ({"axes": {"mechanical_modes": "auto", "tolerance": 0.1}}, "takes a casing without `coating`", "write counts"),
    ],
)  # fmt: skip
def test_what_it_cannot_be_is_said(changed: dict[str, Any], problem: str, remedy: str) -> None:
    with pytest.raises(StudyError) as told:
        oval(**changed)
    (line,) = (line for line in str(told.value).splitlines() if problem in line)
    assert remedy in line


@pytest.mark.parametrize("scheme", ["moreau", "event_driven"])
def test_an_archive_holds_worn_depths(scheme: str, tmp_path: Path) -> None:
    axes = {"scheme": scheme, SECTORS: [12, 24], "scene.speed": [25.0, 50.0]}
    study = oval(axes, output={"wear": {"every": 1}})
    outcome = run_study(study, tmp_path / "a.nc", threads=1)
    assert [check for check in verify(tmp_path / "a.nc") if not check.holds] == []
    (line,) = [line for line in outcome.warnings if line.startswith("max_worn_depth still changes")]
    dataset = outcome.dataset.isel(alpha=0, missing_dims="ignore")
    assert dataset["wear_map"].dims == ("sectors", "speed", "revolution", "sector")
    assert dataset["revolution"].values.tolist() == [1, 2, 3]
    worn, mapped = dataset["worn_depth"].values, dataset["wear_map"].values
    assert np.isfinite(worn).sum(axis=-1).tolist() == [[12, 12], [24, 24]]
    assert np.isfinite(mapped[..., 0]).sum(axis=-1).tolist() == [[1, 3], [1, 3]]
    np.testing.assert_array_equal(mapped[:, 1, 2], worn[:, 1])  # the third ends with the duration
    np.testing.assert_array_equal(dataset["max_worn_depth"], np.nanmax(worn, axis=-1))
    change = 100 * np.abs(1 - dataset["max_worn_depth"][0] / dataset["max_worn_depth"][1]).max()
    assert f"up to {float(change):.2g} % from sectors = 12 to 24" in line
    middles = (np.arange(24) + 0.5) * 2 * np.pi / np.array([[12], [24]])
    np.testing.assert_allclose(dataset["sector_angle"], np.where(middles < 2 * np.pi, middles, np.nan))
    work = np.nansum(2.0 * worn + 2e5 * worn**2 / 2, axis=-1)
    np.testing.assert_allclose(dataset["crushing_work"], work, rtol=1e-12)
    lobes = worn[1, 1].reshape(2, 12)
    np.testing.assert_allclose(lobes[0], lobes[1], rtol=0.02, atol=1e-9)
    assert (lobes[:, :6] == 0).all()
    assert (lobes[:, 7:11] > 1e-6).all()


def test_its_archive_grows_with_the_sectors(tmp_path: Path) -> None:
    wear = {"output": {"wear": {"every": 1}}, "duration": 0.02}
    few = {SECTORS: [4, 12], "scene.speed": [50.0]}
    check_extension(oval(few, **wear), oval({SECTORS: [36, 4, 12], "scene.speed": [100.0, 50.0]}, **wear), tmp_path)


def test_what_matters_is_in_the_identity_of_a_case() -> None:
    def identity(**changed: Any) -> bytes:
        (one,) = hashes_of(oval(**changed))
        return one

    coats = [COATING, COATING | {"yield_force": 3}, COATING | {"hardening": 0}, COATING | {"sectors": 13}]
    every = [identity(casing=CASING | {"coating": coat}) for coat in coats]
    every += [identity(casing=CASING | {"harmonics": [], "coating": COATING}, speed=speed) for speed in (50.0, 60.0)]
    every += [identity(casing=CASING | {"coating": COATING, "angles": 0.1}), identity(casing=UNCOATED)]
    every += [identity(output={"wear": {"every": n}}) for n in (1, 2)]
    assert len(set(every)) == len(every)


@pytest.mark.parametrize("scheme", ["moreau", "event_driven"])
def test_a_sweep_goes_on_with_the_worn_depth(scheme: str, tmp_path: Path) -> None:
    """Two points of almost the same load are one case of twice the time; a border lies off their common end."""
    axes, output = {"scene.load.mean": {"sweep": [4.0, 4.0 * (1 + 1e-11), 2]}}, {"interval": "1 ms"}
    points, whole = (
        run_study(oval({"scheme": scheme, **own}, duration=time, output=output), tmp_path / f"{time}.nc").dataset
        for own, time in ((axes, 0.033), ({}, 0.066))
    )
    np.testing.assert_allclose(points["worn_depth"][-1], whole["worn_depth"], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(points["displacement"][-1], whole["displacement"][33:], rtol=1e-9)
    work = points["crushing_work"].values
    np.testing.assert_allclose(work.sum(), whole["crushing_work"], rtol=1e-9)
    np.testing.assert_allclose(points["border_work"].sum(), whole["border_work"], rtol=1e-9)
    assert 0 < work[1] < 0.1 * work[0]


def test_a_plan_tells_the_static_cut_and_compares_sectors() -> None:
    """The rod is pressed to 4 N/(2e6 N/m) = 2 µm, 7 µm beyond the least gap: cut (7 µm - 1.2 µm)/(1 + 0.12)."""
    plan = plan_study(oval())
    assert (
        "coating      loads, applied statically, press 7 µm into the casing, 99° to 171°, 279° to 351°: "
        "there they cut up to 5.18 µm"
    ) in plan.operators
    compare = [line for line in plan.warnings if "sectors" in line]
    travel = 2e-5 / 2 * 4 * np.pi * 50 * 1e6 / 600
    assert compare == [
        f"worn depths depend on `sectors`, and there is one number of them: "
        f"compare e.g. `axes: {{{SECTORS}: [6, 12]}}`",
        f"casing and load move a contact by up to {travel:.2g} µm while it passes one of 12 sectors, "
        f"more than the static cut of 5.2 µm: take more than {12 * travel / (5.8 / 1.12):.0f}",
    ]
    many = plan_study(oval({SECTORS: [12, 1200]}))
    (wide,) = [line for line in many.warnings if "sectors" in line]
    assert wide.startswith("a step of 2e-05 s passes 1.2 sectors, of which it wears the last: take h below 1.7e-05 s")
    clear = plan_study(oval(casing=CASING | {"gap": "30 um", "coating": COATING}))
    assert "coating      loads, applied statically, leave 18 µm to the casing" in clear.operators
    turning = plan_study(
        oval(casing=CASING | {"harmonics": [CASING["harmonics"][0] | {"order": 2.5}], "coating": COATING})
    )
    (line,) = (line for line in turning.operators if line.startswith("coating"))
    assert line.endswith("press 7 µm into the casing, all around: there they cut up to 5.18 µm")


def test_the_map_and_the_depth_over_the_angle_are_drawn(tmp_path: Path) -> None:
    dataset = run_study(oval(output={"wear": {"every": 2}}), tmp_path / "a.nc", threads=1).dataset
    unit = 1e6 * dataset["worn_depth"].values
    panel, bar = plots.wear_map(dataset).axes
    (mesh,) = panel.collections
    np.testing.assert_allclose(np.ma.filled(mesh.get_array(), 0).ravel(), 1e6 * dataset["wear_map"].values.ravel())
    assert panel.get_ylim() == (0, 2)
    assert bar.get_ylabel() == "worn depth [µm]"
    (line,) = plots.wear_map(dataset.drop_vars("wear_map")).axes[0].patches
    np.testing.assert_allclose(line.get_data().values, unit)
    np.testing.assert_allclose(line.get_data().edges, np.arange(13) * 30.0)
    cases = _cases(dataset, [0], {})
    assert cases is not None
    worn = cases["entries"]["0"]["worn"]
    np.testing.assert_allclose(worn["depth"][::2], unit, atol=0.01)
    np.testing.assert_allclose(worn["angle"][::2], np.arange(12) * 30.0)
    with pytest.raises(ValueError, match="has no coating"):
        plots.wear_map(dataset.drop_vars("worn_depth"))


def test_contacts_without_mass_that_yield_in_turn_have_a_solution_in_each_step(tmp_path: Path) -> None:
    """Newton's method goes to and fro between the branches of their laws, and Lemke's knows two of the three."""
    n, K = 6, 4e5 * (2 * np.eye(6) - np.eye(6, k=1) - np.eye(6, k=-1))
    R = 2e-7 * (3 * np.eye(3) + np.eye(3, k=1) + np.eye(3, k=-1))
    parts = {"mass": 2e-3 * np.eye(n), "stiffness": K, "damping": 2e-5 * K + 0.04 * np.eye(n), "load": np.ones(n)}
    contact = {"contact": np.eye(n)[[1, 3, 5]], "angle": np.array([0.0, 2.0, 4.1])}
    residual = {"residual_flexibility": R, "residual_load": np.full(3, 1e-7)}
    write_matrices(tmp_path / "blade.npz", **parts, **contact, **residual)
    coating = {"yield_force": "2 N", "hardening": 2e5, "sectors": 24}
    casing = {"gap": [2e-5, 2.5e-5, 2e-5], "flexibility": 2e-7, "coating": coating}
    scene = {
        "matrices": {"file": str(tmp_path / "blade.npz")},
        "casing": casing | {"harmonics": [{"order": 2, "amplitude": "15 um"}]},
        "load": {"mean": 4.0, "harmonics": [{"order": 3, "amplitude": 6.0}]},
        "speed": 100.0,
        "duration": 0.02,
    }
    study = {"study": "yields", "scene": scene, "axes": {"scheme": "moreau", "h": 5e-6}, "output": {"interval": 1e-3}}
    assert run_study(read_study(study), tmp_path / "yields.nc", threads=1).counts == {"ok": 1}
