"""Judges: what is said of results and models by theory and by trials; arrays and structures, no settings of a study."""
