from pytest_libero_max.worlds import gl

gl.prepare()  # before any test module imports MuJoCo
