"""Reports: figures and tables of archives on one self-contained HTML page."""

from __future__ import annotations

from workflow.report._origin import duration_of
from workflow.report._page import Written, write_report

__all__ = ["Written", "duration_of", "write_report"]
