"""The first study that is read imports the schemes, which no example may be blamed for."""

from hypothesis import settings

settings.register_profile("study", deadline=None)
settings.load_profile("study")
