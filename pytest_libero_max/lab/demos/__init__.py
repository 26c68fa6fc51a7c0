"""Episodes of an expert, with and without events, written as training data."""
