"""``libero-max plan time``: time that a fleet of workers and policy servers needs for pairs."""
