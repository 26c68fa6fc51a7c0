"""Studies: further arms over the cases of a run, beside Base and Dynamic."""
