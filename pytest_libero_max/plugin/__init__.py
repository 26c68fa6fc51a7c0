"""The pytest plugin: options, collection, fixtures, transport of results, terminal. Thin.

pytest loads :mod:`pytest_libero_max.plugin.hooks` in every session of everybody who has the package
installed, so nothing here imports a simulator, NumPy or a policy before a pair asks for one.
"""
