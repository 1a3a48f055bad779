"""Human bodies: limbs between joints, in clothes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uavdepth.scenes.bars import add_bars
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.shapes import box_uv, lumpy_sphere, tube

Vector = NDArray[np.float64]

SKINS_BGR = np.array([(0.62, 0.75, 1.0), (0.45, 0.6, 0.85), (0.3, 0.42, 0.65), (0.2, 0.27, 0.42)])
_HAIR_BGR = np.array([(0.5, 0.6, 0.8), (0.9, 1.4, 2.0), (1.6, 2.6, 3.6), (3.4, 3.4, 3.4)])
"""Factors on the nearly black texture "rubber"."""
_SHOES_BGR = np.array([(0.8, 0.8, 0.8), (4.5, 4.5, 4.5), (1.0, 1.6, 2.4)])
_BARE = (1.0, 1.0, 1.0)
_SIDES = 5
_LEFT = np.array([1.0, -1.0, 1.0])
_SHOULDER, _HIP, _KNEE, _ANKLE = 0.815, 0.5, 0.275, 0.045
"""Heights of joints as parts of the height of a standing person (Winter, Biomechanics and Motor Control of
Human Movement, 4th edition, figure 4.1, rounded)."""
_UPPER_ARM, _FOREARM = 0.17, 0.155


@dataclass(frozen=True)
class Joints:
    """Where the joints of one body are: (2, 3) each, right and left, as ahead, right and down in body
    heights; the head and the middle of hips and shoulders follow from them."""

    hips: Vector
    knees: Vector
    ankles: Vector
    shoulders: Vector
    elbows: Vector
    hands: Vector
    head: Vector
    """(3,) middle of the head."""

    @classmethod
    def upright(cls, rng: np.random.Generator, stride: float) -> Joints:
        """A person on both feet.

        Args:
            rng: source of the posture.
            stride: swing of the legs from the vertical, radians; 0 stands.
        """
        hips = _pair(0.0, 0.05, _HIP)
        swing = np.array([stride, -stride])
        knees = hips + _hanging(swing, _HIP - _KNEE)
        # The rear leg's knee bends while it is drawn forwards.
        ankles = knees + _hanging(np.where(swing < 0, 1.6, 0.9) * swing, _KNEE - _ANKLE)
        shoulders = _pair(0.01, 0.105, _SHOULDER)
        arms = np.array([-stride, stride]) + rng.uniform(-0.15, 0.25, 2)
        elbows = shoulders + _hanging(arms, _UPPER_ARM) + _pair(0.0, 0.025, 0.0)
        hands = elbows + _hanging(arms + rng.uniform(0.1, 0.5, 2) + (rng.random(2) < 0.2), _FOREARM)
        return cls(hips, knees, ankles, shoulders, elbows, hands, np.array([0.015, 0.0, -0.932]))

    @classmethod
    def seated(cls, lean: float) -> Joints:
        """A person on a saddle at the origin who leans forwards by `lean` radians, hands ahead."""
        hips = _pair(0.0, 0.05, 0.0)
        knees = hips + np.array([(0.2, 0.0, 0.13), (0.19, 0.0, 0.02)])
        ankles = knees + np.array([(-0.05, 0.0, 0.22), (-0.02, 0.0, 0.21)])
        torso = _SHOULDER - _HIP
        shoulders = _pair(torso * np.sin(lean), 0.105, torso * np.cos(lean))
        hands = np.array([(0.32, 0.15, -0.17), (0.32, -0.15, -0.17)])
        elbows = 0.5 * (shoulders + hands) + np.array([-0.03, 0.0, 0.05])
        reach = torso + 0.13
        return cls(
            hips, knees, ankles, shoulders, elbows, hands,
            np.array([reach * np.sin(lean) + 0.03, 0.0, -reach * np.cos(lean)]),
        )  # fmt: skip


def add_body(builder: MeshBuilder, rng: np.random.Generator, joints: Joints, height_m: float) -> None:
    """A dressed body, its joints' origin at the origin.

    Tops are of texture "fabric", trousers of "denim", so that copies may differ in both.
    """
    shoe = _SHOES_BGR[int(rng.integers(len(_SHOES_BGR)))]
    for side in range(2):
        leg = height_m * np.array([joints.hips[side], joints.knees[side], joints.ankles[side]])
        add_limb(builder, leg, height_m * np.array([0.052, 0.036, 0.026]), "denim")
        toe = leg[2] + height_m * np.array([0.1, 0.0, 0.018])
        heel = leg[2] + height_m * np.array([-0.03, 0.0, 0.018])
        add_limb(builder, np.array([heel, toe]), height_m * np.array([0.026, 0.022]), "rubber", shoe)
    sleeves = "fabric" if rng.random() < 0.7 else "skin"
    for side in range(2):
        shoulder, elbow, hand = height_m * np.array(
            [joints.shoulders[side], joints.elbows[side], joints.hands[side]]
        )
        add_limb(builder, np.array([shoulder, elbow]), height_m * np.array([0.031, 0.024]), "fabric")
        wrist = np.array([elbow, hand])
        add_limb(builder, wrist, height_m * np.array([0.024, 0.018]), sleeves)
        add_bars(builder, hand, hand + 0.4 * (hand - elbow), 0.02 * height_m, texture="skin", tint=_BARE)
    hips, shoulders = joints.hips.mean(axis=0), joints.shoulders.mean(axis=0)
    spine = np.array([hips + 0.06 * (hips - shoulders), 0.5 * (hips + shoulders), shoulders])
    stout = rng.uniform(0.9, 1.25)
    add_limb(
        builder, height_m * spine, height_m * stout * np.array([0.095, 0.088, 0.105]), "fabric", depth=0.62
    )
    neck = height_m * shoulders, height_m * joints.head
    add_bars(builder, *neck, 0.032 * height_m, texture="skin", tint=_BARE, sides=5)
    _add_head(builder, rng, height_m * joints.head, height_m)
    if rng.random() < 0.3:
        pack = height_m * (0.3 * hips + 0.7 * shoulders + np.array([-0.1, 0.0, 0.0]))
        _add_ball(builder, rng, pack, height_m * np.array([0.05, 0.085, 0.12]), "fabric", (0.6, 0.5, 0.45))


def add_limb(
    builder: MeshBuilder,
    line_m: Vector,
    radii_m: Vector | list[float],
    texture: str,
    tint: Vector | tuple[float, float, float] = (1.0, 1.0, 1.0),
    depth: float = 1.0,
) -> None:
    """A tapering limb along (R, 3) points with rounded ends; `depth` squeezes it from front to back."""
    line, radii = np.asarray(line_m, float), np.asarray(radii_m, float)
    first, last = line[0] - line[1], line[-1] - line[-2]
    ends = [0.5 * radii[i] * end / np.linalg.norm(end) for i, end in ((0, first), (-1, last))]
    line = np.vstack([line[:1] + ends[0], line, line[-1:] + ends[1]])
    (vertices, faces), uv = tube(line, np.concatenate([0.3 * radii[:1], radii, 0.3 * radii[-1:]]), _SIDES)
    middle = vertices[:, 0].mean()
    vertices[:, 0] = middle + depth * (vertices[:, 0] - middle)
    builder.add(vertices, faces, uv, texture, tint, smooth=True)


def _add_head(builder: MeshBuilder, rng: np.random.Generator, middle: Vector, height_m: float) -> None:
    _add_ball(builder, rng, middle, height_m * np.array([0.052, 0.042, 0.064]), "skin", _BARE, 1)
    hair = _HAIR_BGR[int(rng.integers(len(_HAIR_BGR)))]
    back = middle + height_m * np.array([-0.012, 0.0, -0.012])
    _add_ball(builder, rng, back, height_m * np.array([0.058, 0.054, 0.068]), "rubber", tuple(hair))


def _add_ball(
    builder: MeshBuilder,
    rng: np.random.Generator,
    middle: Vector,
    radii: Vector,
    texture: str,
    tint: tuple[float, ...],
    subdivisions: int = 0,
) -> None:
    vertices, faces = lumpy_sphere(rng, subdivisions, radii, 0.0)
    vertices = vertices + middle
    builder.add(vertices, faces, box_uv(vertices, faces), texture, tint, smooth=True)


def _pair(ahead: float, aside: float, up: float) -> Vector:
    right = np.array([ahead, aside, -up])
    return np.array([right, right * _LEFT])


def _hanging(swing: Vector, length: float) -> Vector:
    """(2, 3) steps of a length hanging down, swung forwards by (2,) radians."""
    return length * np.stack([np.sin(swing), 0.0 * swing, np.cos(swing)], axis=1)
