"""Tables of closed sets of contacts: where there is no room for more, earlier ones give way."""

from typing import Any

import numpy as np
import pytest
from scenes_of_contacts import chain

from scenes import cases_of_file, of_entries, same_bits, step
from workflow import schemes
from workflow.models import Structure, analyse_contacts
from workflow.schemes import Sampling
from workflow.schemes._exact import batch, set_tables
from workflow.schemes._exact.closed_sets import row_length


def plain(heated: bool = True) -> dict[str, Any]:
    """Return the chain with damping that leaves its modes apart, (10/s) M + (2e-5 s) K."""
    own = chain(heated=heated)
    return own | {"damping": 10.0 * own["mass"] + 2e-5 * own["stiffness"]}


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
