"""A run on disk: the durable pairs, and everything that is computed from them."""
