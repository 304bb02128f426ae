"""What schemes with a fixed step share: modal coordinates, contact, marches, samples and balances."""
