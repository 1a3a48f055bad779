"""What lies where in a record: topics, metadata, attachments, and the version of all that."""

from __future__ import annotations

FORMAT = 2
"""Version of the layout: 2 has further cameras and the uncertainty of depth. Newer ones are refused."""

OLDEST_FORMAT = 1
"""The oldest that is read."""

PROFILE = ""
"""MCAP profile: none, the topics carry well-known Foxglove schemas."""

IMAGE, CALIBRATION, DEPTH, SIGMA, NOTE = "image", "calibration", "depth", "depth_sigma", "perception"
"""What there is of each camera; see `camera_topic`."""

SCAN_TOPIC = "/scan"
POINTS_TOPIC = "/scan/points"
POSE_TOPIC = "/vehicle/pose"
FRAMES_TOPIC = "/tf"
STATUS_TOPIC = "/status"
MAVLINK_IN_TOPIC = "/mavlink/in"
"""Bytes as they arrived, one message an arrival; further senders on a UDP port have `/mavlink/in/2`, ..."""
MAVLINK_OUT_TOPIC = "/mavlink/out"
"""Frames as they were handed to the line."""

MAVLINK_ENCODING = "mavlink"

METADATA = "uavdepth"
"""Metadata record at the beginning: format, version, vehicle, wall_offset_ns, part."""
METADATA_END = "uavdepth.end"
"""Metadata record at the end: what was recorded and dropped."""

CONFIGURATION = "configuration.json"
MODEL_CARD = "model_card.json"

CHUNK_BYTES = 256 * 1024
"""What a crash may cost at most besides the last second: with 1 MiB one frame in nine was lost (measured)."""

LOCAL_FRAME = "local"
LEVEL_FRAME = "level"
BODY_FRAME = "body"
"""Frames of the viewers: x forward (or east), y left (or north), z up; those of cameras are OpenCV's."""


def camera_topic(what: str, camera: str = "") -> str:
    """Topic of one camera: `/camera/image`, `/perception`; of a further one `/camera/NAME/...`."""
    if not camera and what == NOTE:
        return f"/{NOTE}"
    return f"/camera/{camera}/{what}" if camera else f"/camera/{what}"


def camera_of(topic: str) -> tuple[str, str] | None:
    """What of which camera lies in `topic` (the main one's name is ""); None for other topics."""
    parts = topic.split("/")
    if parts == ["", NOTE]:
        return NOTE, ""
    if parts[:2] != ["", "camera"] or len(parts) not in (3, 4):
        return None
    return parts[-1], parts[2] if len(parts) == 4 else ""


def camera_frame(camera: str = "") -> str:
    """The viewers' frame of a camera."""
    return f"camera_{camera}" if camera else "camera"
