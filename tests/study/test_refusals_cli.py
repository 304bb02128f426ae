"""The same broken studies through the commands: exit status 2, one clear message, nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest
from study_samples import BLADE
from test_refusals import CHANGED, WHOLE
from typer.testing import CliRunner

from workflow.cli import app

BROKEN = [BLADE.replace(old, new) for _, old, new, *_ in CHANGED] + [text for text, *_ in WHOLE]


@pytest.mark.parametrize("command", ["plan", "run"])
def test_every_broken_study_exits_with_two(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    study = tmp_path / "broken.yaml"
    assert len(BROKEN) >= 50
    for text in BROKEN:
        study.write_text(text, encoding="utf-8")
        result = CliRunner().invoke(app, [command, str(study)])
        assert result.exit_code == 2, text[:200]
        assert "broken.yaml" in result.stderr, text[:200]
        assert not result.stdout.strip()
        assert "Traceback" not in result.stderr
        assert list(tmp_path.iterdir()) == [study]
