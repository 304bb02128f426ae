"""Reports: figures and tables of archives on one self-contained HTML page."""

from __future__ import annotations

from workflow.report._page import ReportFiles, write_report
