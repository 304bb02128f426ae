"""Tests mirror the package; what several of them need stands in ``scenes.py``."""
