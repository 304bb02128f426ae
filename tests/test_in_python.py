"""What a notebook begins with: the public names, studies as dictionaries, statuses in words."""

import json
from pathlib import Path

import pytest

import workflow
from quick import quick

STUDY = json.loads(quick({"alpha": [5.0, 1e9]}).text)
"""As a dictionary; a strong heat coupling ends ``ill_posed``."""


def test_the_public_names_are_listed() -> None:
    assert set(workflow.__all__) == set(dir(workflow))
    assert all(getattr(workflow, name) is not None for name in dir(workflow))


def test_a_dictionary_is_planned_and_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert workflow.plan_study(STUDY).cases == 6
    done = workflow.run_study(STUDY)
    assert done.archive == Path("quick.nc")
    status = done.dataset["status"]
    words = workflow.labels(status)
    assert words.dims == status.dims
    assert set(words.values.flat) == {"ok", "ill_posed"}
    assert set(workflow.labels(done.dataset["runaway"]).values.flat) <= {"bounded", "runaway"}
    with pytest.raises(ValueError, match="flag_meanings"):
        workflow.labels(done.dataset["impacts"])
    assert ((words == "ok") == (status == 0)).all()


def test_a_study_that_was_read_is_read() -> None:
    study = workflow.read_study(STUDY)
    assert workflow.read_study(study) is study
    assert workflow.read_study(study, {"axes.e": [0, 0.7]}).dimensions[0].axes[0].values == (0, 0.7)
