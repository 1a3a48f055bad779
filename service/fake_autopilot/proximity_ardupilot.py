"""ArduPilot's picture of what stands around it: eight faces of 45 degrees, fed by OBSTACLE_DISTANCE.

Every rule here was measured on ArduCopter 4.8-dev in its simulator. Not modelled: OBSTACLE_DISTANCE_3D,
DISTANCE_SENSOR as an input, PRX1_MIN and PRX1_MAX, PRX1_ORIENT 1, PRX_IGN_GND, layers above and below the
horizontal one, the obstacle database.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from service.fake_autopilot.obstacle_words import UNKNOWN_WORD, ObstacleWords

FACE_COUNT = 8
FACE_WIDTH_DEG = 45.0
HEALTHY_MS = 500
"""Health of the proximity bit ends this long after the last message (measured 0.50 to 0.52 s)."""

FACE_EXPIRY_MS = 1000
EXPIRY_CHECK_MS = 750
"""Faces older than a second are dropped, looked for every 0.75 s: 1.0 to 1.75 s (measured 1.0 to 1.8 s)."""

FILTER_RESET_MS = 1000
"""A face that was not updated for so long starts its low-pass anew at the reading."""

SMALLEST_INCREMENT_DEG = 1e-6
"""An increment_f this small counts as 0 (measured with 1e-30)."""

MESSAGE_WORDS = 72


class NotFiniteWordsError(FloatingPointError):
    """An OBSTACLE_DISTANCE with NaN or infinity: ArduPilot's simulator aborts on it."""


@dataclass(frozen=True)
class FaceEcho:
    """One DISTANCE_SENSOR that the autopilot sends back about its faces.

    Args:
        face: 0 (ahead) to 7, clockwise; also the orientation; the sensor id is 10 + face.
        distance_cm: the unfiltered nearest reading, or the maximum for a face that has lost its reading.
        min_distance_cm, max_distance_cm: of the last message.
    """

    face: int
    distance_cm: int
    min_distance_cm: int
    max_distance_cm: int


def face_of(bearing_deg: float) -> int:
    """Face that a bearing falls into: 22.4 degrees is face 0, 22.6 is face 1, -22.6 is face 7."""
    return int(((bearing_deg + FACE_WIDTH_DEG / 2) % 360.0) // FACE_WIDTH_DEG) % FACE_COUNT


class FaceBoundary:
    """Eight faces with one distance each, as the newest message left them.

    Times are whole milliseconds since boot, as the flight code counts them.
    """

    def __init__(self, filter_hz: float = 0.25, yaw_correction_deg: float = 0.0) -> None:
        self.filter_hz = filter_hz
        self.yaw_correction_deg = yaw_correction_deg
        self._raw_m = [0.0] * FACE_COUNT
        self._filtered_m = [0.0] * FACE_COUNT
        self._valid = [False] * FACE_COUNT
        self._ever_valid = [False] * FACE_COUNT
        self._updated_ms = [-(10**9)] * FACE_COUNT
        self._message_ms: int | None = None
        self._checked_ms = 0
        self._min_distance_cm = 0
        self._max_distance_cm = 0

    def update(self, words: ObstacleWords, now_ms: int) -> bool:
        """Take one message in: first every face is emptied, then the elements are visited in their order.

        A face is written when the visits leave it, so a face visited twice keeps its last visit only.

        Returns:
            False if the message was ignored (no increment).

        Raises:
            NotFiniteWordsError: increment_f or angle_offset is NaN or infinite.
        """
        if not words.is_finite:
            raise NotFiniteWordsError(
                f"increment_f {words.increment_f_deg} and angle_offset {words.offset_deg} must be finite"
            )
        increment = words.increment_f_deg
        if abs(increment) < SMALLEST_INCREMENT_DEG:
            increment = float(words.increment_deg)
        if increment == 0.0:
            return False
        self._message_ms = now_ms
        self._min_distance_cm = words.min_distance_cm
        self._max_distance_cm = words.max_distance_cm
        self._valid = [False] * FACE_COUNT
        visited: int | None = None
        nearest_cm = 0
        count = min(int(360.0 / abs(increment) + 0.5), len(words.distances_cm), MESSAGE_WORDS)
        for index, word in enumerate(words.distances_cm[:count]):
            if word in (0, UNKNOWN_WORD) or not words.min_distance_cm <= word <= words.max_distance_cm:
                continue
            face = face_of(index * increment + words.offset_deg + self.yaw_correction_deg)
            if face == visited:
                nearest_cm = min(nearest_cm, word)
                continue
            if visited is not None:
                self._write(visited, nearest_cm, now_ms)
            visited, nearest_cm = face, word
        if visited is not None:
            self._write(visited, nearest_cm, now_ms)
        return True

    def tick(self, now_ms: int) -> None:
        """Drop old faces; call it at least every few milliseconds, the check itself runs every 0.75 s."""
        if now_ms - self._checked_ms < EXPIRY_CHECK_MS:
            return
        self._checked_ms = now_ms
        for face in range(FACE_COUNT):
            if self._valid[face] and now_ms - self._updated_ms[face] > FACE_EXPIRY_MS:
                self._valid[face] = False

    def is_healthy(self, now_ms: int) -> bool:
        """Whether a message came in the last half second, whatever it held."""
        return self._message_ms is not None and now_ms - self._message_ms <= HEALTHY_MS

    def raw_m(self, face: int) -> float | None:
        """Unfiltered distance of a face in metres (PRXR in the log), None where nothing is known or it is
        open."""
        return self._raw_m[face] if self._valid[face] else None

    def filtered_m(self, face: int) -> float | None:
        """Distance of a face after PRX_FILT in metres (PRX in the log): what avoidance works with."""
        return self._filtered_m[face] if self._valid[face] else None

    @property
    def filtered_faces_m(self) -> tuple[float | None, ...]:
        """Filtered distance of all eight faces."""
        return tuple(self.filtered_m(face) for face in range(FACE_COUNT))

    @property
    def nearest_m(self) -> float | None:
        """Nearest unfiltered distance of all faces in metres."""
        return min((self._raw_m[face] for face in range(FACE_COUNT) if self._valid[face]), default=None)

    def echo(self, now_ms: int) -> list[FaceEcho]:
        """What goes out as DISTANCE_SENSOR: nothing at all while no face holds a reading or health is
        gone."""
        if not self.is_healthy(now_ms) or not any(self._valid):
            return []
        return [
            FaceEcho(
                face=face,
                distance_cm=_truncated_cm(self._raw_m[face]) if self._valid[face] else self._max_distance_cm,
                min_distance_cm=_truncated_cm(_metres(self._min_distance_cm)),
                max_distance_cm=_truncated_cm(_metres(self._max_distance_cm)),
            )
            for face in range(FACE_COUNT)
            if self._ever_valid[face]
        ]

    def _write(self, face: int, distance_cm: int, now_ms: int) -> None:
        distance_m = _metres(distance_cm)
        elapsed_ms = now_ms - self._updated_ms[face]
        if elapsed_ms < FILTER_RESET_MS:
            self._filtered_m[face] += self._gain(elapsed_ms / 1000.0) * (distance_m - self._filtered_m[face])
        else:
            self._filtered_m[face] = distance_m
        self._raw_m[face] = distance_m
        self._valid[face] = self._ever_valid[face] = True
        self._updated_ms[face] = now_ms

    def _gain(self, elapsed_s: float) -> float:
        """Gain of a first-order low-pass for one step; 1 with the filter off (PRX_FILT 0)."""
        if self.filter_hz <= 0.0:
            return 1.0
        return elapsed_s / (elapsed_s + 1.0 / (2.0 * math.pi * self.filter_hz))


def _metres(centimetres: int) -> float:
    """Centimetres to metres in single precision, as the flight code does."""
    return float(np.float32(centimetres) * np.float32(0.01))


def _truncated_cm(metres: float) -> int:
    """Metres to whole centimetres, truncated in single precision: 30 cm goes back out as 29 (measured)."""
    return int(np.float32(metres) * np.float32(100.0))
