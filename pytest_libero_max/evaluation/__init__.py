"""A run: its settings and cases, the player of its pairs and the keeper of its records. Knows no pytest."""
