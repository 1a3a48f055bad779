"""The scene `mountain`: a valley with a river between rock faces, peaks, snow, conifers and boulders."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uavdepth.scenes.copies import Template, add_copies
from uavdepth.scenes.description import SceneDescription
from uavdepth.scenes.mesh import MeshBuilder
from uavdepth.scenes.rocks import add_boulder
from uavdepth.scenes.shapes import box_uv
from uavdepth.scenes.terrain import LandNoise, TerrainGrid, Values, fractal_land, smooth_step, stretched_axis
from uavdepth.scenes.undergrowth import add_bush
from uavdepth.scenes.vegetation import TreeKind, add_tree
from uavdepth.scenes.weather import draw_weather

_CORE_M, _SPACING_M, _REACH_M = 156.0, 1.6, 1100.0
_EXTENT_M = 145.0
_CORRIDOR_HALF_WIDTH_M = 6.0
_TREES, _BOULDERS, _BUSHES, _OUTCROPS = 330, 220, 60, 120
_VARIETIES = 5
"""Templates of each kind of tree."""


class _Valley:
    """The shape of the land, before it is sampled.

    Args:
        rng: source of the shape.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self.cliff_north_m = rng.uniform(32.0, 38.0)
        self.cliff_height_m = rng.uniform(14.0, 30.0)
        self.water_m = -rng.uniform(1.0, 2.2)
        self._river_south_m = rng.uniform(16.0, 38.0)
        self._river_half_m = rng.uniform(4.0, 8.0)
        self._bend = rng.uniform(-22.0, 22.0)
        self._meander = LandNoise(rng, 70.0)
        self._wiggle = LandNoise(rng, 38.0)
        self._steepness = rng.uniform(0.35, 0.75)
        self._peak_m = rng.uniform(45.0, 110.0)

    def bend_north_m(self, east_m: ArrayLike) -> Values:
        """How far the whole valley swerves from the east-west line."""
        return np.asarray(self._bend * (np.asarray(east_m, float) / 100.0) ** 2)

    def river_north_m(self, east_m: ArrayLike) -> Values:
        """The river's middle line."""
        east = np.asarray(east_m, float)
        meander = 9.0 * self._meander.at(np.zeros_like(east), east)
        return np.asarray(-self._river_south_m + meander + self.bend_north_m(east))

    def river_half_m(self, east_m: ArrayLike) -> Values:
        """Half the river's width."""
        east = np.asarray(east_m, float)
        return np.asarray(
            self._river_half_m * (1.0 + 0.25 * self._meander.at(np.full_like(east, 300.0), east))
        )

    def height_m(self, rng: np.random.Generator, north: Values, east: Values) -> Values:
        """Heights of land and river bed, 0 at the origin; `rng` draws the noise."""
        across = north - self.bend_north_m(east)
        away = 1.0 - np.exp(-((east / 18.0) ** 2))
        foot = self.cliff_north_m + 12.0 * away * self._wiggle.at(np.zeros_like(east), east)
        tall = self.cliff_height_m * (1.0 + away * 0.9 * self._wiggle.at(np.full_like(east, 500.0), east))
        crumble = (0.5 + 1.7 * away) * fractal_land(rng, north, east, 9.0, 3)
        beyond = across - foot + crumble
        face = np.maximum(tall, 3.0) * smooth_step(beyond, 0.0, 5.0 + 0.12 * tall)

        north_rise = np.maximum(beyond - 5.0, 0.0)
        south_rise = np.maximum(-across - self._river_south_m - 28.0, 0.0)
        far = smooth_step(np.hypot(north, east), 160.0, 400.0)
        ridges = fractal_land(rng, north, east, 170.0, 6, ridged=True)
        # The grid is wide out there: only broad ridges, or its lines would show as spikes.
        ridges += far * (fractal_land(rng, north, east, 420.0, 2, ridged=True) - ridges)
        slope = self._steepness * (_eased(north_rise) + _eased(south_rise))
        mountain = slope * (0.35 + 0.9 * ridges)
        massif = (
            smooth_step(north_rise + south_rise, 20.0, 160.0) * self._peak_m * ridges * (0.45 + 0.9 * far)
        )

        corridor = np.exp(-((east / 12.0) ** 4)) * smooth_step(north, -14.0, -6.0)
        calm = 1.0 - 0.9 * corridor * (1.0 - smooth_step(beyond, 0.0, 6.0))
        rolling = 1.5 * fractal_land(rng, north, east, 34.0, 4) + 0.5 * fractal_land(rng, north, east, 7.0, 3)
        rugged = (
            smooth_step(north_rise + south_rise, 2.0, 30.0) * 3.0 * fractal_land(rng, north, east, 14.0, 4)
        )
        land = face + mountain + massif + (rolling + rugged) * calm
        land -= land.ravel()[np.argmin(np.hypot(north, east))]
        land *= 1.0 - np.exp(-((np.hypot(north, east) / 4.0) ** 2))
        return self._carved(land, north, east)

    def _carved(self, land: Values, north: Values, east: Values) -> Values:
        off = np.abs(north - self.river_north_m(east))
        half = self.river_half_m(east)
        dry = np.maximum(land, self.water_m + 0.4)
        shore = self.water_m + 0.3
        bank = shore + (dry - shore) * smooth_step(off, half, half + 7.0)
        bed = shore - 1.6 * (1.0 - (off / half) ** 2)
        return np.asarray(np.where(off < half, bed, bank))


def build(seed: int) -> SceneDescription:
    """The mountain valley of one seed."""
    rng = np.random.default_rng([seed, 0x3017])
    valley = _Valley(rng)
    lines = stretched_axis(_CORE_M, _SPACING_M, _REACH_M)
    north, east = np.meshgrid(lines, lines, indexing="ij")
    grid = TerrainGrid(lines, lines, valley.height_m(rng, north, east))
    snow_line_m = float(rng.choice([-30.0, 8.0, 28.0, 55.0], p=[0.2, 0.2, 0.3, 0.3]))

    builder = MeshBuilder()
    _add_land(builder, rng, grid, valley, snow_line_m)
    _add_river(builder, valley)

    def ground(north_m: ArrayLike, east_m: ArrayLike) -> Values:
        land = grid.at(north_m, east_m)
        off = np.abs(np.asarray(north_m, float) - valley.river_north_m(east_m))
        wet = off <= valley.river_half_m(east_m)
        return np.asarray(np.where(wet, np.maximum(land, valley.water_m), land))

    _add_outcrops(builder, rng, grid, valley)
    _add_boulders(builder, rng, grid, valley)
    _add_plants(builder, rng, grid, valley, snow_line_m)
    weather = draw_weather(rng, (0.0006, 0.004))
    return weather.over(builder.build(), ground, _EXTENT_M)


def _eased(distance: Values) -> Values:
    """Rises like the distance near the valley and ever slower far away, so that no slope is endless."""
    return np.asarray(220.0 * (1.0 - np.exp(-distance / 220.0)))


def _add_land(
    builder: MeshBuilder, rng: np.random.Generator, grid: TerrainGrid, valley: _Valley, snow_line_m: float
) -> None:
    vertices, faces = grid.triangles()
    slope = np.hypot(*np.gradient(grid.height_m, grid.north_m, grid.east_m)).ravel()
    steep_deg = np.degrees(np.arctan(slope[faces].mean(axis=1)))
    corners = vertices[faces]
    middle = corners.mean(axis=1)
    north, east, height = middle[:, 0], middle[:, 1], -middle[:, 2]
    patches = fractal_land(rng, north, east, 22.0, 4)
    fine = fractal_land(rng, north, east, 8.0, 2)

    texture = np.full(len(faces), "grass", dtype="<U8")
    texture[patches + 0.5 * fine > 0.55] = "soil"
    texture[steep_deg + 9.0 * patches + 5.0 * fine > 31.0] = "scree"
    texture[steep_deg + 7.0 * patches + 3.0 * fine > 42.0] = "rock"
    snowy = (height + 14.0 * patches + 5.0 * fine > snow_line_m) & (
        steep_deg + 4.0 * fine < 46.0 + 12.0 * smooth_step(np.hypot(north, east), 150.0, 400.0)
    )
    texture[snowy] = "snow"
    off = np.abs(north - valley.river_north_m(east)) - valley.river_half_m(east)
    texture[(off < 2.5 + 2.0 * patches) & (height < valley.water_m + 1.1)] = "gravel"

    lush = np.array([1.0, 1.0, 1.0]) * rng.uniform([0.8, 0.85, 0.75], [1.1, 1.1, 1.4])
    shade = (1.0 + 0.14 * patches + 0.05 * fine)[:, None]
    tint = np.where((texture == "grass")[:, None], lush, 1.0) * shade
    tint = np.where(snowy[:, None], 1.0, tint)
    uv = box_uv(vertices, faces)
    for name in np.unique(texture):
        part = texture == name
        used, local = np.unique(faces[part], return_inverse=True)
        builder.add(vertices[used], local.reshape(-1, 3), uv[part], str(name), tint[part], smooth=True)


def _add_river(builder: MeshBuilder, valley: _Valley) -> None:
    east = np.arange(-420.0, 420.1, 3.0)
    middle, half = valley.river_north_m(east), valley.river_half_m(east)
    down = np.full_like(east, -valley.water_m)
    south = np.stack([middle - half, east, down], axis=1)
    northern = np.stack([middle + half, east, down], axis=1)
    count = len(east)
    here = np.arange(count - 1)
    faces = np.concatenate(
        [
            np.stack([here, here + 1, here + count], axis=1),
            np.stack([here + 1, here + 1 + count, here + count], axis=1),
        ]
    )
    vertices = np.concatenate([south, northern])
    builder.add(vertices, faces, vertices[:, :2], "water", (1.0, 1.0, 1.0), smooth=True)


def _keeps_corridor(places: NDArray[np.float64], valley: _Valley, reach_m: ArrayLike) -> NDArray[np.bool_]:
    """(K,) True where a thing of that reach stands neither at the take-off place nor before the face."""
    north, east = places[:, 0], places[:, 1]
    reach = np.asarray(reach_m, float)
    aside = np.abs(east) > _CORRIDOR_HALF_WIDTH_M + reach
    outside = aside | (north < 0.0) | (north > valley.cliff_north_m + 12.0)
    return np.asarray(outside & (np.hypot(north, east) > 8.0 + reach))


def _rise_over_run(grid: TerrainGrid, places: NDArray[np.float64]) -> Values:
    """(K,) steepness of the ground around places."""
    north, east = places[:, 0], places[:, 1]
    along_north = grid.at(north + 1.0, east) - grid.at(north - 1.0, east)
    along_east = grid.at(north, east + 1.0) - grid.at(north, east - 1.0)
    return np.asarray(np.hypot(along_north, along_east) / 2.0)


def _may_grow(
    grid: TerrainGrid, valley: _Valley, places: NDArray[np.float64], reach_m: float
) -> NDArray[np.bool_]:
    """(K,) True on gentle dry ground off the corridor."""
    off = np.abs(places[:, 0] - valley.river_north_m(places[:, 1]))
    dry = off > valley.river_half_m(places[:, 1]) + 1.5
    return dry & _keeps_corridor(places, valley, reach_m) & (_rise_over_run(grid, places) < 0.75)


def _feet(grid: TerrainGrid, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 3) NED points of the ground at places."""
    return np.column_stack([places, -grid.at(places[:, 0], places[:, 1])])


def _add_outcrops(builder: MeshBuilder, rng: np.random.Generator, grid: TerrainGrid, valley: _Valley) -> None:
    """Blocks that stand out of the northern face, which a grid of heights cannot show."""
    east = rng.normal(0.0, 45.0, _OUTCROPS)
    north = valley.cliff_north_m + valley.bend_north_m(east) + rng.uniform(1.0, 12.0, _OUTCROPS)
    places = np.column_stack([north, east])
    places = places[_rise_over_run(grid, places) > 0.8]
    for north_m, east_m, down_m in _feet(grid, places):
        size = rng.uniform(2.0, 7.0)
        down = down_m + 0.35 * size
        add_boulder(
            builder, rng, north_m + 0.22 * size, east_m, down, size, sunk=0.1, tint=rng.uniform(0.9, 1.1)
        )


def _add_boulders(builder: MeshBuilder, rng: np.random.Generator, grid: TerrainGrid, valley: _Valley) -> None:
    """A third under the northern face, a quarter in and along the river, the rest anywhere."""
    sizes = np.clip(rng.lognormal(0.1, 0.75, _BOULDERS), 0.5, 6.0)
    east = rng.uniform(-150.0, 150.0, _BOULDERS)
    under_face = valley.cliff_north_m + valley.bend_north_m(east) + rng.normal(-3.0, 6.0, _BOULDERS)
    in_river = valley.river_north_m(east) + rng.normal(0.0, 9.0, _BOULDERS)
    anywhere = rng.uniform(-150.0, 150.0, _BOULDERS)
    choice = rng.random(_BOULDERS)
    north = np.select([choice < 0.35, choice < 0.6], [under_face, in_river], anywhere)
    places = np.column_stack([north, east])
    for which in np.flatnonzero(_keeps_corridor(places, valley, sizes)):
        (foot,) = _feet(grid, places[which : which + 1])
        add_boulder(builder, rng, foot[0], foot[1], foot[2], float(sizes[which]), sunk=rng.uniform(0.2, 0.4))


def _add_plants(
    builder: MeshBuilder, rng: np.random.Generator, grid: TerrainGrid, valley: _Valley, snow_line_m: float
) -> None:
    tree_line_m = rng.uniform(30.0, 60.0)
    places = rng.uniform(-155.0, 155.0, (_TREES * 6, 2))
    height = grid.at(places[:, 0], places[:, 1])
    grove = LandNoise(rng, 45.0).at(places[:, 0], places[:, 1]) + rng.normal(0.0, 0.25, len(places))
    grows = (grove > 0.1) & (height < tree_line_m + rng.normal(0.0, 8.0, len(places)))
    grows &= _may_grow(grid, valley, places, reach_m=3.5)
    chosen = np.flatnonzero(grows)[:_TREES]
    feet = _feet(grid, places[chosen])

    broadleaf = 0.25 if rng.random() < 0.4 else 0.03
    kinds: tuple[TreeKind, ...] = ("conifer", "snowy_conifer", "broadleaf", "birch", "dead")
    luck = rng.random(len(feet))
    snowy = -feet[:, 2] > snow_line_m + rng.normal(4.0, 5.0, len(feet))
    species = np.select([snowy, luck < 0.5 * broadleaf, luck < broadleaf, luck > 0.97], [1, 2, 3, 4], 0)
    variety = rng.integers(_VARIETIES, size=len(feet))
    heights = rng.uniform(4.0, 14.0, len(feet))
    for number in np.unique(species):
        for which in range(_VARIETIES):
            tall = rng.uniform(7.0, 12.0)
            make = partial(add_tree, rng=rng, north_m=0.0, east_m=0.0, ground_down_m=0.0, height_m=tall)
            here = (species == number) & (variety == which)
            add_copies(
                builder, rng, Template.of(partial(make, kind=kinds[number]), tall), feet[here], heights[here]
            )

    places = rng.uniform(-130.0, 130.0, (_BUSHES, 2))
    feet = _feet(grid, places[_may_grow(grid, valley, places, reach_m=1.5)])
    for foot in feet[-feet[:, 2] < min(snow_line_m, tree_line_m)]:
        add_bush(builder, rng, foot[0], foot[1], foot[2], rng.uniform(0.5, 2.0))
