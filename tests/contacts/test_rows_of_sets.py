"""Sets of closed contacts as rows of numbers: each way to their poles gives the system."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from scenes_of_contacts import chain

from scenes import cases_of_file, of_entries, same_bits, step
from workflow import schemes
from workflow.models import Structure, analyse_contacts, contact_system
from workflow.schemes import Sampling
from workflow.schemes._exact import batch, closed_sets, set_tables
from workflow.schemes._exact.closed_sets import SetAnyAlpha, closed_set_of, row_length


class Way(NamedTuple):
    entries: dict[str, Any]
    closed: list[bool]
    alpha: float
    friction: float
    is_linked: bool
    general: bool


def plain(heated: bool = True) -> dict[str, Any]:
    """Return the chain with damping that leaves its modes apart, (10/s) M + (2e-5 s) K."""
    own = chain(heated=heated)
    return own | {"damping": 10.0 * own["mass"] + 2e-5 * own["stiffness"]}


SLIDES = {"tangent": np.eye(5)[[1, 3]]}
WAYS = {
    "open": Way(plain(heated=False), [False, False], 0.0, 0.0, is_linked=False, general=False),
    "closed": Way(plain(heated=False), [True, True], 0.0, 0.0, is_linked=False, general=False),
    "warm": Way(plain(), [True, False], 0.0, 0.0, is_linked=False, general=False),
    "warm and open": Way(plain(), [False, False], 9.0, 0.0, is_linked=False, general=False),
    "heated": Way(plain(), [False, True], 9.0, 0.0, is_linked=True, general=False),
    "heated twice": Way(plain(), [True, True], 9.0, 0.0, is_linked=True, general=True),
    "friction": Way(plain() | SLIDES, [True, False], 9.0, 0.3, is_linked=True, general=True),
    "coupled damping": Way(chain(), [False, True], 9.0, 0.0, is_linked=True, general=True),
}


@pytest.mark.parametrize("name", WAYS)
def test_a_row_is_the_system(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """X' = A X + B w and its signals, by [η, u, ξ] of uncoupled blocks; the general solver only where it must."""
    way, closed = WAYS[name], np.array(WAYS[name].closed)
    basis = analyse_contacts(of_entries(way.entries))
    basis = basis if "heat_capacity" in way.entries else basis.unheated
    if not way.general:
        monkeypatch.setattr(closed_sets, "real_blocks", None)
    row = np.empty(row_length(basis))
    assert SetAnyAlpha(basis, closed, way.friction, 0.1).fill(row[None], np.array([way.alpha])).all()
    s, system = closed_set_of(row), contact_system(basis, closed, way.alpha, way.friction)
    assert system is not None
    assert (s.is_linked, s.is_open) == (way.is_linked, not closed.any())
    k, j = s.blocks, s.firsts
    D = np.zeros((2 * k + j, 2 * k + j))
    D[:k, k : 2 * k], D[2 * k :, 2 * k :] = np.eye(k), -np.diag(s.first[0, :j])
    D[k : 2 * k, :k], D[k : 2 * k, k : 2 * k] = -np.diag(s.block[1, :k]), -np.diag(s.block[0, :k])
    into, out = s.inward.T, s.outward.T
    size, heats = len(system.A), basis.rate.size
    assert out @ D @ into == pytest.approx(system.A, abs=1e-12 * np.abs(system.A).max())
    assert into @ out == pytest.approx(np.eye(size), abs=1e-12)
    assert out @ s.source[:, :size].T == pytest.approx(system.B, abs=1e-12 * np.abs(system.B).max())
    assert pytest.approx(system.inputs, rel=1e-14) == s.source[:, size : size + 2].T
    for o, rows in enumerate((system.signals, np.hstack([np.zeros((2, size - heats)), basis.heat]))):
        shown = np.hstack([s.outputs[:, 2 * o, :k], s.outputs[:, 2 * o + 1, :k], s.slow_outputs[:, o, :j]])
        assert shown == pytest.approx(rows @ out, abs=1e-12 * np.abs(rows @ out).max(initial=0.0))


@pytest.fixture(scope="module")
def structure() -> Structure:
    own: Structure = of_entries(plain())
    return own


def conditions(*chosen: int) -> dict[str, Any]:
    """Return some of twelve cases: each has an α, three of them have none."""
    i = np.array(chosen)
    gaps = np.array([3e-5, 5.5e-5]) * (1 + 1e-3 * i[:, None])
    return {"gaps": gaps, "amplitude": 28.0, "frequency": 65.0, "alpha": 2.0 * (i % 10), "e": 0.3 * (i % 3)}


OVER = Sampling(0.03, 1e-3, 31)


def test_tables_of_an_earlier_α_make_room(structure: Structure, monkeypatch: pytest.MonkeyPatch) -> None:
    scheme = schemes.load("event_driven")
    some = cases_of_file(structure, 12, **conditions(*range(12)))
    usual = scheme.compute(scheme.init(structure, 0.0, scheme.Options()), some, OVER)
    length = row_length(analyse_contacts(structure))
    monkeypatch.setattr(set_tables, "MOST_BYTES", 6 * 8 * length)
    made = []
    monkeypatch.setattr(batch, "SetTable", lambda shared: made.append(set_tables.SetTable(shared)) or made[-1])
    few = scheme.compute(scheme.init(structure, 0.0, scheme.Options()), some, OVER)
    assert len(made) > 2
    assert all(table.count <= 6 for table in made)
    assert np.array_equal(few.histories["temperature"], usual.histories["temperature"])


def test_a_case_of_more_sets_than_a_table_holds_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    own = chain(heated=False)
    five = of_entries({name: own[name] for name in ("mass", "stiffness", "load")} | {"contact": np.eye(5)})
    case = cases_of_file(five, 1, gaps=1e-4 * np.arange(1.0, 6.0), load_harmonics=[[900.0, 60.0, 0.0]], mean=300.0)
    over = Sampling(0.1, 1e-2, 11)
    usual = step(five, case, 0.0, over, "event_driven")
    made = []
    monkeypatch.setattr(set_tables, "MOST_BYTES", 0)  # four rows
    monkeypatch.setattr(batch, "SetTable", lambda shared: made.append(set_tables.SetTable(shared)) or made[-1])
    few = step(five, case, 0.0, over, "event_driven")
    assert len(made) > 2
    assert same_bits(few, usual)
