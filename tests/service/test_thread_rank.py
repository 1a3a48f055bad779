"""Threads that compute where processors are few."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

PRODUCT = """
import os
import service.cli
import numpy as np
np.ones((600, 600), np.float32) @ np.ones((600, 600), np.float32)
print(len(os.listdir("/proc/self/task")))
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="threads are counted in /proc")
def test_no_matrix_product_wakes_a_thread_that_spins_beside_the_network() -> None:
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    said = subprocess.run([sys.executable, "-c", PRODUCT], env=environment, capture_output=True, check=True)
    assert int(said.stdout) == 1
