"""Common parts of the schemes with a fixed step: modal coordinates, contact, marches, samples and balances."""
