"""Rows of the tips of a block, ``(row, lane)``: their states and what has been counted."""

from __future__ import annotations

DISPLACEMENT, VELOCITY, TEMPERATURE, IMPULSE, GAP = range(5)
"""Its state at the last step end, the sum of impulses and the clearance."""

TOUCHING, IMPACTS, CONTACT_TIME, PENETRATION, HOTTEST = range(5, 10)
"""What has been counted so far; the highest temperature is that of the load periods that have ended."""

PERIOD_IMPULSE, PERIOD_CONTACT, PERIOD_HOTTEST, PERIOD_IMPACTS = range(10, 14)
"""Impulse, contact time and impacts at the beginning of the present load period, and its highest temperature."""

NEW_DISPLACEMENT, NEW_VELOCITY, NEW_TEMPERATURE, STEP_IMPULSE = range(14, 18)
"""The tip at the end of the present step and the impulse in it, stored for ``take_marks`` and ``observe``."""

ROWS = STEP_IMPULSE + 1
