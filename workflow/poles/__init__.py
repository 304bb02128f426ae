"""Real blocks that step alone: what separates a motion whose coordinates a matrix couples."""

from __future__ import annotations

from workflow.poles.real_blocks import RealBlocks, missed_share, real_blocks
