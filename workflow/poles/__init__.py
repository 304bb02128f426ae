"""Real blocks: separation of a linear system into uncoupled blocks of first and second order."""

from __future__ import annotations

from workflow.poles.real_blocks import RealBlocks, real_blocks, relative_residual
