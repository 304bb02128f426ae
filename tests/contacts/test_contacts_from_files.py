"""How contacts enter: rows of a file chosen by labels, tables of modes, residuals, angles, opposite stops."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from random_contacts import random_entries
from scipy.io import mmwrite
from scipy.linalg import eigh

from scenes import of_file
from workflow.cases import arrange, full_structure
from workflow.models import Array, Contacts, Structure, UnusableMatricesError, write_matrices
from workflow.models._matrix_entries import Chosen, given_by, in_si
from workflow.models.chain import Rayleigh
from workflow.run import run_study
from workflow.study import Study, StudyError, read_study

SIZE, WARM = 6, 3
RATIO = 0.01
TWO = "frequency,damping_ratio,tip_1,tip_2"


def entries(count: int = 3, massless: bool = False, seed: int = 5) -> dict[str, Any]:
    """Return a structure with contacts, friction and heat."""
    made = random_entries(np.random.default_rng(seed), count, SIZE, WARM, True, massless)
    del made["damping"], made["load"]
    return made | {"contact_labels": np.array([f"tip {k}" for k in range(count)])}


def in_tables(place: Path, entries: dict[str, Any]) -> tuple[dict[str, Any], Array]:
    """Write a structure as tables of all its modes; return the model's parameters and the modes."""
    values, shapes = eigh(entries["stiffness"], entries["mass"])
    rates, warm = eigh(entries["conductance"], entries["heat_capacity"])
    count = len(entries["contact"])
    ends = [f"_{k + 1}" for k in range(count)] if count > 1 else [""]
    ratio = np.full(SIZE, RATIO)
    tips, tangents, heat = ((entries[name] @ modes).T for name, modes in (
        ("contact", shapes), ("tangent", shapes), ("thermal_contact", warm)))  # fmt: skip
    heads = [["frequency", "damping_ratio", *(f"{name}{end}" for name in ("tip", "tangent") for end in ends)],
             ["rate [1/s]", *(f"tip{end} [1/√(J/K)]" for end in ends)]]  # fmt: skip
    tables = {
        "table": np.column_stack([np.sqrt(values) / (2 * np.pi), ratio, tips, tangents]),
        "heat": np.column_stack([rates, heat]),
        "coupling": shapes.T @ entries["coupling"] @ warm,
    }
    tables |= {name: entries[f"residual_{end}"] for name, end in _RESIDUALS.items() if f"residual_{end}" in entries}
    for (name, table), head in zip(tables.items(), [*heads, *[None] * 3], strict=False):
        text = "" if head is None else f"{','.join(head)}\n"
        rows = (",".join(f"{value:.17g}" for value in row) for row in table)
        (place / f"{name}.csv").write_text(text + "\n".join(rows) + "\n", encoding="utf-8")
    return {name: f"{name}.csv" for name in tables}, shapes


_RESIDUALS = {"residual": "flexibility", "residual_tangent": "tangent"}


def pressing(entries: dict[str, Any]) -> Array:
    """Return the constant loads that hold every contact 10 µm beyond the gap."""
    rows = np.atleast_2d(entries["contact"])
    return np.asarray(entries["stiffness"] @ np.linalg.pinv(rows) @ np.full(len(rows), 2.2e-5))


CASING = {"gap": 1.2e-5, "harmonics": [{"order": 2, "amplitude": 5e-6, "phase": 0.3},
                                       {"frequency": 190, "amplitude": 3e-6}]}  # fmt: skip
RUBS = {"coefficient": 0.2, "sliding_speed": 60.0, "heat_share": 0.5}


def study(place: Path, model: dict[str, Any], axes: dict[str, Any] | None = None, **scene: Any) -> Study:
    whole = {**model, "casing": CASING, "duration": 0.02, "speed": 50.0, **scene}
    text = {"study": "contacts", "scene": whole, "axes": {"scheme": "event_driven", **(axes or {})}}
    (place / "study.yaml").write_text(json.dumps(text))
    return read_study(place / "study.yaml")


@pytest.mark.parametrize(("count", "massless"), [pytest.param(3, False, marks=pytest.mark.slow), (3, True), (1, True)])
def test_a_table_of_all_modes_is_its_matrices(count: int, massless: bool, tmp_path: Path) -> None:
    """Contacts, tangents, heat and residuals of tables, exact and stepped, are those of the file of matrices."""
    made = entries(count, massless)
    np.savez(tmp_path / "blade.npz", **made)
    tables, shapes = in_tables(tmp_path, made)
    models = {"matrices": {"file": "blade.npz", "damping": {"ratio": RATIO}}}, {"modes": tables}
    runs: list[xr.Dataset] = []
    for k, (model, steady) in enumerate(zip(models, (pressing(made), shapes.T @ pressing(made)), strict=True)):
        angles = made["angle"].tolist() if k else None  # those of the file
        casing = CASING | ({} if angles is None else {"angles": angles})
        axes = {"scheme": ["event_driven", "moreau"], "e": 0.3, "h": 1e-5}
        more = {"casing": casing, "load": {"steady": steady.tolist()}, "friction": RUBS}
        read = study(tmp_path, model, axes, **more)
        assert len(read.contacts) == (count if count > 1 else 0)
        runs.append(run_study(read, tmp_path / f"{k}.nc", threads=1).dataset.load())
    assert (runs[0]["status"] == 0).all()
    assert float(runs[0]["contact_impulse"].min()) > 0
    for name in ("displacement", "temperature", "contact_impulse"):
        one, other = (run[name].values for run in runs)
        assert np.abs(one - other).max() <= 1e-10 * np.abs(one).max(), name


def modes_of(place: Path, tables: dict[str, Any]) -> Structure:
    return full_structure(arrange(study(place, {"modes": tables})).settings(0))


def test_one_tip_of_heat_is_that_of_all_contacts(tmp_path: Path) -> None:
    made = entries()
    made["thermal_contact"] = made["thermal_contact"][[1, 1, 1]]
    tables, _ = in_tables(tmp_path, made)
    of_each = modes_of(tmp_path, tables)
    lines = (tmp_path / "heat.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "heat.csv").write_text("\n".join(["rate,tip", *(",".join(row.split(",")[:2]) for row in lines[1:])]))
    for_all = modes_of(tmp_path, tables)
    for structure in (of_each, for_all):
        assert structure.contacts.labels == ("1", "2", "3")
        rise = structure.contacts.heat @ structure.uniform_rise
        np.testing.assert_allclose(rise, 1.0, rtol=1e-12)
    np.testing.assert_array_equal(of_each.contacts.heat, for_all.contacts.heat)


def test_rows_of_a_study_have_several_tips(tmp_path: Path) -> None:
    """By their names or in order, as in a file; of unlike numbers of tips, or with other names, they are refused."""
    (tmp_path / "m.csv").write_text(f"{TWO}\n900,0.01,1,2\n700,0.02,2,-1\n")
    (tmp_path / "h.csv").write_text("rate,tip_1,tip_2\n1,0.5,1\n")
    named = [dict(zip(TWO.split(","), row, strict=True)) for row in ([900, 0.01, 1, 2], [700, 0.02, 2, -1])]
    ways = ({"table": "m.csv", "heat": "h.csv"}, {"table": named, "heat": [{"rate": 1, "tip_1": 0.5, "tip_2": 1}]},
            {"table": [list(row.values()) for row in named], "heat": [[1, 0.5, 1]]})  # fmt: skip
    found = [modes_of(tmp_path, way).contacts for way in ways]
    for contacts in found:
        assert contacts.normal.tolist() == found[0].normal.tolist()
        assert contacts.heat.tolist() == found[0].heat.tolist()
    for wrong in ({"tip_1": 1, "tip_3": 2}, {"tip": 1, "tip_2": 2}, {"tip_1": 1, "tangent_1": 2}):
        no_row = (
            "is not known here" if "tangent_1" in wrong else "no row of the table; write frequency, damping_ratio, tip"
        )
        with pytest.raises(StudyError, match=no_row):
            study(tmp_path, {"modes": {"table": [{"frequency": 9, "damping_ratio": 0, **wrong}]}})
    with pytest.raises(StudyError, match="has 2 rows of 3 and 4 numbers; write rows of 4"):
        study(tmp_path, {"modes": {"table": [[9, 0, 1, 2], [8, 0, 1]]}})


NOT_TABLES: dict[str, tuple[dict[str, str], str]] = {
    "a tip that is missing": (
        {"table": "frequency,damping_ratio,tip_1,tip_3\n9,0,1,1\n"},
        "write frequency, damping_ratio, tip_1, tip_2",
    ),
    "a tangent for each": (
        {"table": f"{TWO},tangent_1\n9,0,1,2,1\n"},
        "write frequency, damping_ratio, tip_1, tip_2, tangent_1, tangent_2",
    ),
    "a tip that moves nowhere": ({"table": f"{TWO}\n9,0,1,0\n8,0,1,0\n"}, "`tip_2` has an impossible value"),
    "more than modes": (
        {"table": f"{TWO}\n9,0,1,2\n"},
        "contacts 1, 2 depend on each other: leave one out, or write `residual`",
    ),
    "a tangent along the tip": (
        {"table": "frequency,damping_ratio,tip,tangent\n9,0,1,2\n"},
        "`tangent` is parallel to the contact's direction",
    ),
    "heat of two": (
        {"table": f"{TWO},tip_3\n9,0,1,0,0\n8,0,0,1,0\n7,0,0,0,1\n", "heat": "rate,tip_1,tip_2\n1,1,1\n"},
        "`heat` has the tips tip_1, tip_2, and `table` has 3: write one for each, or one `tip` for all",
    ),
    "a residual of another shape": (
        {"table": f"{TWO}\n9,0,1,2\n8,0,2,1\n", "residual": "1e-6\n"},
        "`residual.csv`, line 1: `1e-6` is not 2 numbers",
    ),
    "an indefinite residual": (
        {"table": f"{TWO}\n9,0,1,2\n8,0,2,1\n", "residual": "1e-6,2e-6\n2e-6,1e-6\n"},
        "`residual` is not symmetric and positive definite",
    ),
    "a tangential one alone": (
        {"table": "frequency,damping_ratio,tip\n9,0,1\n", "residual_tangent": "1e-6\n"},
        "`residual_tangent` is given without `residual`",
    ),
}


@pytest.mark.parametrize("name", NOT_TABLES)
def test_what_is_no_table_of_contacts_is_refused(name: str, tmp_path: Path) -> None:
    tables, said = NOT_TABLES[name]
    for table, text in tables.items():
        (tmp_path / f"{table}.csv").write_text(text)
    with pytest.raises(StudyError) as refused:
        study(tmp_path, {"modes": {table: f"{table}.csv" for table in tables}})
    assert said in str(refused.value).replace("; ", ": "), refused.value


def contacts_of(entries: dict[str, Any], **chosen: Any) -> Contacts:
    return given_by(entries, Chosen(**chosen), Rayleigh())[1]


PER_CONTACT = ("normal", "tangent", "heat", "angle", "residual_coupling", "residual_load", "residual_steady")


@given(st.permutations(range(4)), st.integers(1, 4), st.booleans(), st.integers(0, 2**20))
@settings(max_examples=40, deadline=None)
def test_rows_follow_the_labels_that_are_chosen(order: list[int], most: int, massless: bool, seed: int) -> None:
    """Of any contacts in any order: those of one as of several, all that belongs to them."""
    made = entries(4, massless, seed)
    rng = np.random.default_rng(seed)
    if massless:
        made |= {"residual_coupling": rng.normal(size=(4, WARM)), "residual_load": rng.normal(size=(1, 4))}
        made |= {"residual_steady": rng.normal(size=(4, 1))}
    whole, which = contacts_of(made), order[:most]
    names = tuple(f"tip {k}" for k in which)
    for chosen in (names, names[0]) if most == 1 else (names,):
        picked = contacts_of(made, contact=chosen)
        assert picked.labels == names
        for name in PER_CONTACT[: 7 if massless else 4]:
            np.testing.assert_array_equal(getattr(picked, name), getattr(whole, name)[which], err_msg=name)
        for name in ("residual", "residual_tangent") if massless else ():
            np.testing.assert_array_equal(getattr(picked, name), getattr(whole, name)[np.ix_(which, which)])


@given(st.integers(2, 5), st.integers(0, 2**20), st.booleans())
@settings(max_examples=40, deadline=None)
def test_rows_that_depend_on_each_other_are_refused_with_their_labels(count: int, seed: int, massless: bool) -> None:
    """A combination of others, or two stops against the same third; contacts without mass may."""
    rng = np.random.default_rng(seed)
    made = entries(count, massless, seed)
    last = rng.uniform(0.3, 1, count - 1) @ made["contact"][:-1] if count > 2 else made["contact"][0] * 2
    made["contact"][-1], names = last, [f"tip {k}" for k in range(count)]
    if massless:
        assert contacts_of(made).labels == tuple(names)
        return
    with pytest.raises(UnusableMatricesError) as refused:
        contacts_of(made)
    assert refused.value.problem == f"contacts {', '.join(names)} depend on each other"
    made["contact"][-1] = -2.5 * made["contact"][0]
    assert contacts_of(made).opposite == [(0, count - 1, pytest.approx(2.5))]
    more = {name: np.vstack([made[name], made[name][-1:]]) for name in ("contact", "tangent", "thermal_contact")}
    more |= {"angle": np.zeros(count + 1), "contact_labels": np.array([*names, "again"])}
    with pytest.raises(UnusableMatricesError, match=f"contacts tip {count - 1}, again depend|contacts .*again depend"):
        contacts_of(made | more)


NO_CONTACTS: dict[str, tuple[dict[str, Any], dict[str, Any], str]] = {
    "labels": ({"contact_labels": np.array(["a", "b"])}, {}, "`contact_labels` has 2 labels: write 3, as `contact`"),
    "a label twice": ({"contact_labels": np.array(["a", "b", "a"])}, {}, "has 'a' twice: name each contact once"),
    "a zero row": ({"contact": np.eye(3, SIZE) * [[1], [0], [1]]}, {}, "`contact` of contact tip 1 is zero everywhere"),
    "rows of the tangent": ({"tangent": np.ones((2, SIZE))}, {}, "`tangent` has 2 rows for 3 contacts: write"),
    "those chosen": ({"tangent": np.ones((2, SIZE))}, {"contact": ("tip 0", "tip 2")}, "`tangent` has 2 rows: write"),
    "a tangent along": ({"tangent": 2 * entries()["contact"]}, {}, "`tangent` of contact tip 0 is parallel to the"),
    "shares": ({"thermal_contact": np.full((3, WARM), 0.5)}, {}, "`thermal_contact` are 1.5 in sum: they must be 1"),
    "an angle": ({"angle": np.zeros(2)}, {}, r"`angle` has the shape \(2,\): write finite numbers of \(3,\)"),
    "not finite": ({"residual_load": np.array([0, np.nan, 0])}, {}, "`residual_load` has an entry that is not finite"),
    "asymmetric": ({"residual_flexibility": np.triu(np.ones((3, 3)))}, {}, "`residual_flexibility` is not symmetric"),
    "displacements": (
        {},
        {"contact": (0, 1)},
        "are chosen by displacements, and the file has residuals by `contact_labels`",
    ),
    "an unknown one": ({}, {"contact": ("tip 9", 1)}, "`contact: tip 9` is neither a label nor a vector .*`tip 0`"),
    "rows in a list": ({}, {"contact": ("contact", 1)}, "`contact: contact` has 3 rows: name it alone, not in a list"),
}


@pytest.mark.parametrize("name", NO_CONTACTS)
def test_what_is_no_contact_is_refused(name: str) -> None:
    changed, chosen, said = NO_CONTACTS[name]
    with pytest.raises(UnusableMatricesError, match=said):
        contacts_of(entries(massless=True) | changed, **chosen)


def test_contacts_are_64_at_most() -> None:
    made = {"mass": np.eye(70), "stiffness": np.eye(70), "load": np.ones(70)}
    assert contacts_of(made | {"contact": np.eye(64, 70)}).count == 64
    with pytest.raises(UnusableMatricesError, match="it has 65 contacts: choose up to 64"):
        contacts_of(made | {"contact": np.eye(65, 70)})


def test_a_contact_heats_the_temperature_of_its_label() -> None:
    """Of several and of one, of a label of the study and of the file; else that of its displacement."""
    size, labels = 4, np.array(list("abcd"))
    made = {"mass": np.eye(size), "stiffness": np.eye(size), "heat_capacity": np.eye(size), "conductance": np.eye(size)}
    made["labels"], warm = labels, {"thermal_labels": labels[::-1]}
    for chosen, at in ((("a", "c"), [0, 2]), ("b", [1]), ((1, "d"), [1, 3])):
        assert contacts_of(made, contact=chosen).heat.tolist() == np.eye(size)[at].tolist()
    assert contacts_of(made | warm, contact=("a", "c")).heat.tolist() == np.eye(size)[[3, 1]].tolist()
    assert contacts_of(made | warm, contact=(0, 2)).heat.tolist() == np.eye(size)[[0, 2]].tolist()
    named = made | {"contact": np.ones((1, size)), "contact_labels": ["d"]}
    assert contacts_of(named).heat.tolist() == [[0, 0, 0, 1]]
    assert contacts_of(named, contact=("d", "a")).normal.tolist() == [[1, 1, 1, 1], [1, 0, 0, 0]]


def test_a_directory_and_millimetres(tmp_path: Path) -> None:
    """One labelled contact in columns of Matrix Market; lengths and flexibilities in mm."""
    made = entries(1, massless=True) | {"residual_steady": [2.0], "residual_load": [3.0], "load": np.ones(SIZE)}
    for name in ("contact", "tangent"):
        made[name] = made[name].T
    for name, value in made.items():
        if name == "contact_labels":
            (tmp_path / "contact_labels.txt").write_text("tip 0\n")
        else:
            mmwrite(tmp_path / f"{name}.mtx", np.atleast_2d(value), precision=17)
    contacts = of_file(tmp_path, contact="tip 0", units="mm-t-s").contacts
    assert contacts.labels == ("tip 0",)
    for name, value in (("residual_steady", 2e-3), ("residual_load", 3e-3)):
        assert getattr(contacts, name).tolist() == [value]
    np.testing.assert_allclose(contacts.residual, 1e-3 * np.ravel(made["residual_flexibility"])[:, None], rtol=1e-14)
    assert in_si({"residual_steady": 1.0, "angle": 1.0}, "mm-t-s") == {"residual_steady": 1e-3, "angle": 1.0}


def test_contacts_beside_what_is_held_or_has_no_mass(tmp_path: Path) -> None:
    """Several contacts need no load; one on a held freedom, or on one without mass, is named."""
    held = np.diag([1e6, 2e6, 1e20, 3e6])
    rows = {"contact": np.eye(2, 4), "contact_labels": ["a", "b"]}
    path = write_matrices(tmp_path / "held.npz", mass=np.eye(4), stiffness=held, **rows)
    structure = of_file(path)
    assert structure.mechanical_size == 3
    assert structure.input_contacts.tolist() == np.eye(2, 4).tolist()
    for entry, said in (
        ({"mass": np.eye(4), "contact": np.eye(4)[[0, 2]]}, "contact b acts only on what is held"),
        (
            {"mass": np.diag([1, 0, 1, 1]), "stiffness": held + 1e5 * np.ones((4, 4))},
            "contact b moves a part without mass",
        ),
    ):
        np.savez(path, **{"mass": np.eye(4), "stiffness": held, **rows, **entry})
        with pytest.raises(UnusableMatricesError, match=said):
            of_file(path)


def test_the_angle_of_one_contact_turns_the_casing(tmp_path: Path) -> None:
    """In the file, of a label among several, or in the study: as phases k ψ of the orders k."""
    made = {name: value for name, value in entries().items() if name != "tangent"}
    angle = float(made["angle"][1])
    np.savez(tmp_path / "three.npz", **made)
    one = {name: made[name][1] for name in ("contact", "thermal_contact", "angle")} | {"contact_labels": ["it"]}
    np.savez(tmp_path / "one.npz", **{**made, **one})
    plain = {name: value for name, value in {**made, **one}.items() if name not in ("angle", "contact_labels")}
    np.savez(tmp_path / "plain.npz", **plain)
    turned = [{**CASING["harmonics"][0], "phase": 0.3 + 2 * angle}, CASING["harmonics"][1]]
    ways: list[tuple[dict[str, Any], dict[str, Any]]] = [
        ({"file": "three.npz", "contact": ["tip 1"]}, CASING),
        ({"file": "one.npz"}, CASING),
        ({"file": "plain.npz"}, CASING | {"angles": [angle]}),
        ({"file": "plain.npz"}, CASING | {"harmonics": turned}),
        ({"file": "one.npz"}, CASING | {"angles": 0}),
    ]
    runs = []
    for k, (model, casing) in enumerate(ways):
        load = {"load": {"steady": pressing(made).tolist()}, "casing": casing}
        runs.append(
            run_study(study(tmp_path, {"matrices": model}, **load), tmp_path / f"{k}.nc", threads=1).dataset.load()
        )
    impulse = [float(run["contact_impulse"].item()) for run in runs]
    np.testing.assert_allclose(impulse[:3], impulse[3], rtol=1e-11)
    assert abs(impulse[4] - impulse[3]) > 1e-4 * impulse[3]
    assert [float(run["contact_angle"].item()) for run in runs[:3]] == [angle] * 3
    np.savez(tmp_path / "one.npz", **{**made, **one, "contact": np.eye(SIZE)[0], "angle": -0.9})
    at_first = {"casing": {"gap": 4e-6, "harmonics": CASING["harmonics"][:1]}}
    with pytest.raises(StudyError, match=r"the tip starts inside the casing, at 0\.0 m with a gap of 4e-06 m"):
        study(tmp_path, {"matrices": {"file": "one.npz"}}, **at_first)


def test_friction_that_makes_the_residual_indefinite_is_refused(tmp_path: Path) -> None:
    """R = 1e-6, R^t = 2e-6: up to µ = 1/2, along an axis too; on a casing of flexibility 1e-6 up to µ = 1."""
    made = entries(1, massless=True) | {"residual_flexibility": [[1e-6]], "residual_tangent": [[2e-6]]}
    np.savez(tmp_path / "one.npz", **made)
    every = (([0.1, 0.499], 0.0, True), ([0.5, 0.1], 0.0, False), ([0.5, 0.999], 1e-6, True), ([0.5, 1], 1e-6, False))
    for axis, flexibility, fine in every:
        axes = {"scene.friction.coefficient": axis}
        given, casing = ({"matrices": {"file": "one.npz"}}, axes), CASING | {"flexibility": flexibility}
        if fine:
            study(tmp_path, *given, friction=RUBS, casing=casing)
            continue
        with pytest.raises(StudyError, match=r"friction.coefficient: (0\.5|1) makes the symmetric part of R - µ R\^t"):
            study(tmp_path, *given, friction=RUBS, casing=casing)


def test_constant_loads_move_contacts_without_mass_beside_their_modes(tmp_path: Path) -> None:
    """By `residual_steady`: gaps are narrower by it, and the recorded displacement has it."""
    made, moved = entries(2, massless=True), np.array([2e-6, -1e-6])
    np.savez(tmp_path / "given.npz", **made, residual_steady=moved)
    np.savez(tmp_path / "plain.npz", **made)
    load, axes = {"steady": pressing(made).tolist()}, {"scheme": ["event_driven", "moreau"], "h": 1e-5}
    runs = []
    for name, gaps in (("given", [1.2e-5, 1.2e-5]), ("plain", (1.2e-5 - moved).tolist())):
        whole = study(tmp_path, {"matrices": {"file": f"{name}.npz"}}, axes, load=load, casing=CASING | {"gap": gaps})
        runs.append(run_study(whole, tmp_path / f"{name}.nc", threads=1).dataset.load())
    given, plain = runs
    assert (given["contact_impulse"] > 0).all()
    np.testing.assert_allclose(given["contact_force"].values, plain["contact_force"].values, rtol=1e-9, atol=1e-12)
    both = [run["displacement"].transpose(..., "contact", "t").values for run in runs]
    np.testing.assert_allclose(both[0] - both[1] - moved[:, None], 0, atol=1e-9 * np.abs(both[0]).max())
    np.testing.assert_allclose(given["max_penetration"].values, plain["max_penetration"].values, atol=1e-15)


BALL = {"mass": np.eye(1), "stiffness": np.zeros((1, 1)), "contact": [[1.0], [-2.0]], "load": [1.0]}
WAVE = [{"frequency": 40, "amplitude": 1e-5}, {"order": 2, "amplitude": -5e-6}]


@pytest.mark.parametrize(
    ("gap", "more", "room"),
    [
        ([3e-5, -5.9e-5], {}, 1e-6),
        ([3e-5, -6.1e-5], {}, -1e-6),
        ([3e-5, -6e-5], {}, 0.0),
        (3e-5, {"clearance": [0, -2.9e-5]}, 3e-6),
        (3e-5, {"clearance": [0, -3.1e-5]}, -3e-6),
        (1.6e-5, {"harmonics": WAVE}, 3e-6),
        (1.4e-5, {"harmonics": WAVE}, -3e-6),
        ([3e-5, -1e-5], {"harmonics": WAVE, "amplitude": [1e-6, 1.2e-5]}, -1e-6),
        ([3e-5, -1e-5], {"harmonics": WAVE, "amplitude": [1e-6, 1.1e-5]}, 2e-6),
    ],
)
def test_opposite_stops_need_room_between_them(gap: Any, more: dict[str, Any], room: float, tmp_path: Path) -> None:
    """d_j + c d_i > 0 by the amplitudes, c = 2 here, over all values of the axes."""
    np.savez(tmp_path / "ball.npz", **BALL)
    axes = {f"scene.casing.{name}": more[name] for name in ("clearance",) if name in more}
    axes |= {"scene.casing.harmonics.0.amplitude": more["amplitude"]} if "amplitude" in more else {}
    casing = {"gap": gap, "harmonics": more.get("harmonics", [])}
    start = {"casing": casing, "initial": "static", "load": {"mean": 1.0}}
    given = {"matrices": {"file": "ball.npz"}}
    if room > 0:
        study(tmp_path, given, axes, **start)
        return
    with pytest.raises(
        StudyError, match=r"scene.casing.gap: contacts `1` and `2` are opposite stops (\S+) m apart"
    ) as no:
        study(tmp_path, given, axes, **start)
    assert float(str(no.value).split("stops ")[1].split(" m apart")[0]) == pytest.approx(room, abs=1e-18)
