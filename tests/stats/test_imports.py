from __future__ import annotations

import subprocess
import sys


def test_statistics_know_neither_pytest_nor_a_simulator() -> None:
    code = (
        "import importlib, pkgutil, sys, pytest_libero_max.stats as room\n"
        "for module in pkgutil.iter_modules(room.__path__):\n"
        "    importlib.import_module(f'{room.__name__}.{module.name}')\n"
        "mine = {name.split('.')[1] for name in sys.modules if name.startswith('pytest_libero_max.')}\n"
        "assert mine == {'errors', 'stats'}, mine\n"
        "heavy = {'pytest', 'mujoco', 'robosuite', 'numba', 'cv2'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_report_does_not_wait_for_scipy_stats() -> None:
    code = (
        "import sys, pytest_libero_max.report.writers.report_files; assert 'scipy.stats' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
