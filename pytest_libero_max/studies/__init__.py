"""Studies: which arms are played over which cases, beside the pair of Base and Dynamic."""
