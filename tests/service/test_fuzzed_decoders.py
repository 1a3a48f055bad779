"""Nothing that comes from the network brings out anything but a named error."""

from __future__ import annotations

import pytest
from fuzz_decoders import fuzz
from hypothesis import given, settings
from hypothesis import strategies as st

from service.publisher.received import ReceivedReport
from service.publisher.video import VideoHeader
from service.publisher.wire import WireError


@pytest.mark.parametrize("seed", [1, 2])
def test_damaged_samples_are_read_or_refused_by_name(seed: int) -> None:
    tally = fuzz(1_200, seed)
    assert tally.inputs == 1_200
    assert all(tally.refused[name] for name in ("scan", "status", "received", "depth picture"))


@settings(max_examples=60)
@given(st.binary(max_size=300))
def test_no_bytes_raise_anything_else(data: bytes) -> None:
    for kind in (ReceivedReport, VideoHeader):
        with pytest.raises(WireError, match=kind.__name__):
            kind.decode(data)
