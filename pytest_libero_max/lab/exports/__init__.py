"""The formats of ``libero-max report RUN --export=FORMAT=FILE``: a module for each."""
