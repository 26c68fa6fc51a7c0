from pytest_libero_max.worlds.rendering import gl

gl.prepare()  # before any test module imports MuJoCo
