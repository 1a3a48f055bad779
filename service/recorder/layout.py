"""What lies where in a record: topics, metadata, attachments, and the version of all that."""

from __future__ import annotations

FORMAT = 1
"""Version of the layout; readers refuse others by name."""

PROFILE = ""
"""MCAP profile: none, the topics carry well-known Foxglove schemas."""

CAMERA_TOPIC = "/camera/image"
CALIBRATION_TOPIC = "/camera/calibration"
DEPTH_TOPIC = "/camera/depth"
SCAN_TOPIC = "/scan"
POINTS_TOPIC = "/scan/points"
POSE_TOPIC = "/vehicle/pose"
FRAMES_TOPIC = "/tf"
PERCEPTION_TOPIC = "/perception"
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
CAMERA_FRAME = "camera"
"""Frames of the viewers: x forward (or east), y left (or north), z up; the camera's is OpenCV's."""
