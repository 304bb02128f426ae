"""Judges: assessment of results and models by theory and by trials, from arrays and structures, not study settings."""
