"""What a plan says of bases: the depth of heat at each contact, the basis of `auto`, references with fixed counts."""

from pathlib import Path
from typing import Any

import pytest
from scenes_of_contacts import chain, study

from workflow.plan import plan_study
from workflow.study import read_study

FRICTION = {"coefficient": 0.1, "sliding_speed": 100.0, "heat_share": 0.01}
COUNT = 40


def planned(place: Path, axes: dict[str, Any], **more: Any) -> tuple[str, ...]:
    entries = chain(COUNT)
    entries["conductance"] = 400 * entries["conductance"]  # heat enters about a node in a contact
    exact = {"scheme": "event_driven", "h": 1e-4, "mechanical_modes": 6, **axes}
    return plan_study(study(place, entries, scene={"friction": FRICTION}, axes=exact, **more)).warnings


@pytest.mark.parametrize("basis", ["craig_bampton", "rubin"])
@pytest.mark.parametrize(("modes", "contacts"), [(8, "contact `mid`, contact `end`"), (36, "")])
def test_thermal_modes_that_are_too_few_are_told_of_each_contact(
    tmp_path: Path, basis: str, modes: int, contacts: str
) -> None:
    lines = planned(tmp_path, {"reduction": basis, "thermal_modes": modes})
    found = [line for line in lines if "times the depth" in line]
    assert [line.split(" at ")[1].split(": ")[0] for line in found] == ([contacts] if contacts else [])
    assert all(line.endswith("keep more, or use krylov") for line in found)


def test_krylov_resolves_the_depth_with_as_few(tmp_path: Path) -> None:
    assert not [line for line in planned(tmp_path, {"reduction": "krylov", "thermal_modes": 8}) if "depth" in line]


def test_auto_takes_krylov_where_no_basis_is_named(tmp_path: Path) -> None:
    auto = {"mechanical_modes": "auto", "tolerance": 1e-3}

    def basis(**more: Any) -> tuple[str, Any]:
        read = read_study(study(tmp_path, **more))
        (own,) = (axis.values for axis in read.axes() if axis.path == "reduction")
        return own[0], None if read.reference is None else read.reference.values.get("reduction")

    assert basis(axes=auto) == ("krylov", None)
    assert basis(axes=auto | {"reduction": "rubin"}) == ("rubin", None)
    assert basis(axes={"mechanical_modes": 2}, reference=auto) == ("craig_bampton", "krylov")
    assert basis(axes={"reduction": "rubin"}, reference=auto) == ("rubin", None)


@pytest.mark.parametrize(("counts", "told"), [({"mechanical_modes": 20}, True), ({"mechanical_modes": "full"}, False)])
def test_a_reference_with_fixed_counts_is_told(tmp_path: Path, counts: dict[str, Any], told: bool) -> None:
    reference = {"scheme": "event_driven", "thermal_modes": "full", **counts}
    lines = planned(tmp_path, {"reduction": "krylov", "thermal_modes": 8}, reference=reference)
    found = [
        line
        for line in lines
        if line.startswith("nothing states the error of the reference's basis, 20 mechanical + 39 thermal ")
    ]
    assert len(found) == told
