"""Rules for environments of others: whether an episode there is an episode of LIBERO."""
