"""Camera timing and camera strength, the studies of the paper: arms, checks, statistics and report."""
