"""The formats of ``libero-max report RUN --export=ctrf=FILE``: a module for each."""
