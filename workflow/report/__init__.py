"""Reports: figures and tables of archives on one self-contained HTML page."""

from __future__ import annotations

from workflow.report._origin import duration_of
from workflow.report._page import ReportFiles, write_report

__all__ = ["ReportFiles", "duration_of", "write_report"]
