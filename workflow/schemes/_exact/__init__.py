"""The event-driven solver: closed-form motion between certified events."""
