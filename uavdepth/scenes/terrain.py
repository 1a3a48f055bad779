"""Ground that is not flat: noise over the land, and a grid of heights that is also the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.shapes import grid_faces

Values = NDArray[np.float64]

_TABLE = 64
"""Side of the table of gradients; the noise repeats after that many wavelengths."""


class LandNoise:
    """Gradient noise over north and east (K. Perlin, "Improving noise", SIGGRAPH 2002).

    Args:
        rng: source of the gradients.
        wavelength_m: distance between neighbouring bumps.
    """

    def __init__(self, rng: np.random.Generator, wavelength_m: float) -> None:
        angles = rng.uniform(0.0, 2 * np.pi, (_TABLE, _TABLE))
        self._gradients = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        self._wavelength_m = wavelength_m
        self._shift = rng.uniform(0.0, _TABLE, 2)

    def at(self, north_m: ArrayLike, east_m: ArrayLike) -> Values:
        """Values of about -1 to 1, with two continuous derivatives."""
        x = np.asarray(north_m, float) / self._wavelength_m + self._shift[0]
        y = np.asarray(east_m, float) / self._wavelength_m + self._shift[1]
        x0, y0 = np.floor(x), np.floor(y)
        u, v = x - x0, y - y0
        i, j = x0.astype(int) % _TABLE, y0.astype(int) % _TABLE
        fade_u, fade_v = _fade(u), _fade(v)

        def corner(di: int, dj: int) -> Values:
            gradient = self._gradients[(i + di) % _TABLE, (j + dj) % _TABLE]
            return np.asarray(gradient[..., 0] * (u - di) + gradient[..., 1] * (v - dj))

        low = corner(0, 0) + fade_u * (corner(1, 0) - corner(0, 0))
        high = corner(0, 1) + fade_u * (corner(1, 1) - corner(0, 1))
        return np.asarray((low + fade_v * (high - low)) * 1.5)


def fractal_land(
    rng: np.random.Generator,
    north_m: ArrayLike,
    east_m: ArrayLike,
    wavelength_m: float,
    octaves: int,
    ridged: bool = False,
) -> Values:
    """Sum of noises, each of half the wavelength and half the height.

    Args:
        rng: source of the noises.
        north_m, east_m: places, of equal shapes.
        wavelength_m: of the largest bumps.
        octaves: how many.
        ridged: fold the noise into sharp ridges, 0 (valley) to 1 (crest); else about -1 to 1.
    """
    total = np.zeros(np.broadcast(north_m, east_m).shape)
    weight = np.ones_like(total)
    strength = 0.0
    for octave in range(octaves):
        noise = LandNoise(rng, wavelength_m / 2**octave).at(north_m, east_m)
        if ridged:
            noise = (1.0 - np.minimum(np.abs(noise), 1.0)) ** 2 * weight
            weight = np.clip(noise * 1.6, 0.0, 1.0)
        total += noise * 0.5**octave
        strength += 0.5**octave
    return total / strength


def level_ground(north_m: ArrayLike, east_m: ArrayLike) -> Values:
    """Height 0 everywhere."""
    return np.zeros(np.broadcast(north_m, east_m).shape)


def smooth_step(values: ArrayLike, low: ArrayLike, high: ArrayLike) -> Values:
    """0 below `low`, 1 above `high`, and between them a rise without kinks."""
    t = np.clip((np.asarray(values, float) - low) / (np.asarray(high, float) - low), 0.0, 1.0)
    return np.asarray(t * t * (3 - 2 * t))


@dataclass(frozen=True)
class TerrainGrid:
    """Heights on a grid whose lines may lie unevenly; each cell is two triangles.

    Args:
        north_m, east_m: (R,) and (C,) increasing positions of the lines.
        height_m: (R, C) heights, up positive.
    """

    north_m: Values
    east_m: Values
    height_m: Values

    def at(self, north_m: ArrayLike, east_m: ArrayLike) -> Values:
        """Height on the triangles themselves; outside the grid the border's heights go on."""
        i, u = _cell(self.north_m, np.asarray(north_m, float))
        j, v = _cell(self.east_m, np.asarray(east_m, float))
        h = self.height_m
        h00, h10, h01, h11 = h[i, j], h[i + 1, j], h[i, j + 1], h[i + 1, j + 1]
        first = h00 + u * (h10 - h00) + v * (h11 - h10)
        second = h00 + v * (h01 - h00) + u * (h11 - h01)
        return np.asarray(np.where(u >= v, first, second))

    def triangles(self) -> tuple[Values, NDArray[np.int32]]:
        """(N, 3) NED vertices and (M, 3) faces, wound to face up."""
        north, east = np.meshgrid(self.north_m, self.east_m, indexing="ij")
        vertices = np.stack([north, east, -self.height_m], axis=-1).reshape(-1, 3)
        return vertices, grid_faces(*self.height_m.shape)


def stretched_axis(core_m: float, spacing_m: float, reach_m: float, growth: float = 1.16) -> Values:
    """Grid lines `spacing_m` apart out to +-`core_m`, then ever wider apart out to +-`reach_m`."""
    count = round(core_m / spacing_m)
    lines = list(np.arange(count + 1) * spacing_m)
    step = spacing_m
    while lines[-1] < reach_m:
        step *= growth
        lines.append(lines[-1] + step)
    half = np.array(lines)
    return np.concatenate([-half[:0:-1], half])


def _fade(t: Values) -> Values:
    return np.asarray(t**3 * (t * (6 * t - 15) + 10))


def _cell(lines: Values, position: Values) -> tuple[NDArray[np.intp], Values]:
    inside = np.clip(position, lines[0], lines[-1])
    index = np.clip(np.searchsorted(lines, inside, side="right") - 1, 0, len(lines) - 2)
    return index, (inside - lines[index]) / (lines[index + 1] - lines[index])
