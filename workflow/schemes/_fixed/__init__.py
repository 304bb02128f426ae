"""Common parts of the schemes with a fixed step: modal coordinates, contact, marches, samples and balances.

A block of the structure (``blocks``) is a pair of states that steps alone. A block of cases (``stepping.CaseBlock``)
are up to 64 cases that are stepped at once, each in a lane; a pack are the lanes that one or a few instructions take.
"""
