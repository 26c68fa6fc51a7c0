"""The tiny substrate: one small scene without a robot model, for dry runs and tests."""
