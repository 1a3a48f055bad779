"""Which threads go first where processors are few."""

from __future__ import annotations

import os
import sys
import threading

_STAND_BACK_NICE = 5
"""About a third of the processor time of a thread that has not stood back, where both want it."""

_SWITCH_S = 0.001


def stand_back() -> None:
    """Let the threads of the flight path go before the calling one; where that cannot be had, do nothing.

    On Linux each thread has a niceness of its own.
    """
    if not sys.platform.startswith("linux"):
        return
    try:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _STAND_BACK_NICE)
    except OSError:
        return  # it was nicer already


def switch_quickly() -> None:
    """Make a thread that computes in Python give way after 1 ms instead of 5.

    After each call of the network the flight path waits for the interpreter.
    """
    sys.setswitchinterval(_SWITCH_S)
