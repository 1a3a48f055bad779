"""A network's second file, in which most convolutions multiply whole numbers of eight bits.

It lies beside the network's own file and is made from it by `uavdepth quantize`, which measures what that
costs. It carries the digest of the file that it was made from: a network that was replaced must not fly with
the numbers of the one before.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

INT8_SUFFIX = "-int8"
"""`NAME.onnx` has its 8-bit file in `NAME-int8.onnx`."""

SOURCE_METADATA_KEY = "uavdepth.int8_of"
"""Key of the ONNX metadata_props entry with the digest of the network's own file."""


def int8_beside(path: Path) -> Path:
    """Where a network's 8-bit file is looked for."""
    return path.with_name(f"{path.stem}{INT8_SUFFIX}{path.suffix}")


def digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def source_digest(session: Any) -> str | None:
    """Digest of the file that a loaded network was made from; None if it is no 8-bit one."""
    text = session.get_modelmeta().custom_metadata_map.get(SOURCE_METADATA_KEY)
    return None if text is None else str(text)
