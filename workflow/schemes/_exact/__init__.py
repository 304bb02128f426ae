"""The exact solver: closed-form motion between certified events."""
