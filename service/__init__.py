"""The program that flies: cameras, autopilot link, Zenoh, configuration, command line."""

import os

# Read when numpy is loaded. Matrix products here are thin: a second thread gains nothing on them, and spins
# for milliseconds after each, on a core that the network needs (measured on two cores: half the pictures).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
