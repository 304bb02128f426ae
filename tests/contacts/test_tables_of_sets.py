"""Tables of closed sets of contacts: where there is no room for more, earlier ones give way."""

from typing import Any

import numpy as np
import pytest
from scenes_of_contacts import chain

from scenes import cases_of_file, of_entries, same_bits, sampling, step
from workflow.models import analyse_contacts
from workflow.schemes._exact import batch, set_tables
from workflow.schemes._exact.closed_sets import row_length


def made(patch: pytest.MonkeyPatch, most_bytes: int) -> list[Any]:
    """Give tables so much room; return those that are made from now on."""
    tables: list[Any] = []
    patch.setattr(set_tables, "MOST_BYTES", most_bytes)
    patch.setattr(batch, "SetTable", lambda shared: tables.append(set_tables.SetTable(shared)) or tables[-1])
    return tables


def test_tables_of_an_earlier_α_make_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of twelve cases, each with an α of its own, some without; damping leaves the modes apart."""
    own, i, over = chain(), np.arange(12), sampling(0.03, 1e-3)
    structure = of_entries(own | {"damping": 10.0 * own["mass"] + 2e-5 * own["stiffness"]})
    gaps = np.array([3e-5, 5.5e-5]) * (1 + 1e-3 * i[:, None])
    rub = {"gaps": gaps, "amplitude": 28.0, "frequency": 65.0, "alpha": 2.0 * (i % 10), "e": 0.3 * (i % 3)}
    some = cases_of_file(structure, 12, **rub)
    usual = step(structure, some, 0.0, over, "event_driven")
    tables = made(monkeypatch, 6 * 8 * row_length(analyse_contacts(structure)))
    few = step(structure, some, 0.0, over, "event_driven")
    assert len(tables) > 2
    assert all(table.count <= 6 for table in tables)
    assert same_bits(few, usual)


def test_a_case_of_more_sets_than_a_table_holds_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    own, over = chain(heated=False), sampling(0.1, 1e-2)
    five = of_entries({name: own[name] for name in ("mass", "stiffness", "load")} | {"contact": np.eye(5)})
    case = cases_of_file(five, 1, gaps=1e-4 * np.arange(1.0, 6.0), load_harmonics=[[900.0, 60.0, 0.0]], mean=300.0)
    usual = step(five, case, 0.0, over, "event_driven")
    tables = made(monkeypatch, 0)  # four rows
    few = step(five, case, 0.0, over, "event_driven")
    assert len(tables) > 2
    assert same_bits(few, usual)
