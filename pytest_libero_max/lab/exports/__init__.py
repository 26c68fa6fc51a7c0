"""The formats of ``libero-max report --export``: a module for each."""
