"""Moreau's step along the nodes of a long chain."""
