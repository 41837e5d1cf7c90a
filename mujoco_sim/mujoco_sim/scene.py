# SPDX-License-Identifier: Apache-2.0
"""The surroundings of the robot: floor, light, walls and terrain."""

from collections.abc import Callable
import logging
import math
from typing import NamedTuple

import mujoco
import numpy as np
from robot_description.mujoco.builder import add_sky
from wasd_core.errors import one_line, SimulationError, UserError
from wasd_core.robot_io import TIME_STEP

from mujoco_sim.flats import make_flat, make_office

LOGGER = logging.getLogger(__name__)
ROOM_SIZE = 6.0
WALL = (0.75, 0.72, 0.66, 1.0)
BOARDS = ((0.47, 0.40, 0.33), (0.43, 0.36, 0.29), (0.36, 0.30, 0.24))
# Wood, dark wood, and what covers sofas and beds.
FURNITURE = (
    (0.62, 0.44, 0.26, 1.0),
    (0.40, 0.27, 0.17, 1.0),
    (0.30, 0.45, 0.55, 1.0),
    (0.55, 0.30, 0.28, 1.0),
    (0.38, 0.48, 0.34, 1.0),
)
SUN = 'sun'
WALL_HEIGHT = 0.5
LARGEST_SHADOW = 25.0  # shadows of a larger plan would be too coarse [m]

# The robot starts at the origin, looking along x, with a plane of this length before it [m].
AHEAD = 0.8
LENGTH = 8.0
HALF_WIDTH = 3.0
GROUND = (0.34, 0.40, 0.46, 1.0)
TREAD = 0.30
STEPS = 6
# How long the landing is between stairs up and stairs down [m].
LANDING = 3.6
CELL = 0.25
# Stepping stones are so long and wide [m], about as far apart as a Go2's feet are, sideways.
STONE = 0.25
# Where a patch of ice begins, far enough for a robot to be at speed, and how long it is [m].
ICE_AHEAD, ICE_LENGTH = 2.0, 3.0
# A foot's own friction, of priority 1, counts on any ground but this.
ICE_PRIORITY = 2
# How deep a gap is: deeper than a leg is long [m].
PIT = 0.5
# How far stepping stones go on [m].
STONES = 3.0
# A course is so long; in it boxes, each half of a slope, what lies on top, and how many steps
# there are [m]; how high and wide all is, least and most [m], [deg].
COURSE, COURSE_BOXES, COURSE_RAMP, COURSE_TOP, COURSE_STEPS = 12.0, 2.0, 0.9, 1.0, 3
COURSE_SPANS = {
    'boxes': (0.05, 0.15),
    'step': (0.08, 0.20),
    'gap': (0.08, 0.20),
    'slope': (8.0, 20.0),
    'stairs': (0.08, 0.15),
}
# What is random in where an edge lies [m]: each seed meets it with another leg.
EDGE = 0.3


def add_scene(
    spec: mujoco.MjSpec, world: str, seed: int = 0, time_step: float = TIME_STEP
) -> None:
    """
    Put a robot's specification into a world: a name, a terrain with its size, or a file.

    The file is a model or a floor plan: a map's YAML file, or a picture with its scale.

    `seed` decides what is random in a terrain; `time_step` [s] is that of physics.

    Raises:
        SimulationError: an unknown name, a size that is none, a file that is no model and no plan.
    """
    spec.option.timestep = time_step
    # Not implicit: that adds motor damping after the contacts are solved, and wheels then slip
    # (0.47 mm while speeding up to 0.2 m/s, against 0.05 mm).
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # At 1, the default, feet creep on a slope: odometry of a walk up 15 degrees is off by 4.2 %
    # of the path, against 0.9 % at 10.
    spec.option.impratio = 10.0
    spec.visual.global_.offwidth = 1920
    spec.visual.global_.offheight = 1080
    spec.visual.headlight.ambient = np.full(3, 0.35)
    spec.visual.headlight.diffuse = np.full(3, 0.45)
    spec.visual.quality.shadowsize = 4096
    # Half the width of what may have a shadow [m]; the floor is speckled where that ends.
    spec.visual.map.shadowclip = 8.0
    # The page draws soft shadows in corners, at the highest quality, unless it is told not to:
    # half of the time of a picture without a graphics card.
    spec.add_numeric(name='filament.ao.enabled', size=1, data=[0.0])
    spec.stat.extent = 1.0
    spec.stat.center = np.zeros(3)
    name, colon, _ = world.partition(':')
    if world in WORLDS:
        WORLDS[world](spec)
    elif name in TERRAINS and colon:
        _flat(spec)
        TERRAINS[name].build(spec, *_sizes(world), np.random.default_rng(seed))
    else:
        # Here, because few worlds are files.
        from wasd_core.map_picture import is_plan

        from mujoco_sim.world_file import attach_world_file

        add = add_floor_plan if is_plan(world) else attach_world_file
        add(spec, world)


def _sizes(world: str) -> list[float]:
    name, _, text = world.partition(':')
    spans = TERRAINS[name].spans
    words = text.split(',')
    if len(words) > len(spans):
        count = 'one number' if len(spans) == 1 else f'at most {len(spans)} numbers'
        raise SimulationError(f'--world {world}: wanted {count} after the colon')
    words += [str(span.usual) for span in spans[len(words) :]]
    return [_number(world, word, span) for word, span in zip(words, spans, strict=True)]


def _number(world: str, word: str, span: 'Span') -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not span.least <= value <= span.most:
        raise SimulationError(
            f'--world {world}: wanted a number from {span.least:g} to {span.most:g} '
            f'after the {span.after}'
        )
    if span.whole and not value.is_integer():
        raise SimulationError(f'--world {world}: wanted a whole number after the {span.after}')
    return value


def _flat(spec: mujoco.MjSpec) -> None:
    add_sky(spec, [0.55, 0.68, 0.82], [0.90, 0.93, 0.96])
    _add_sun(spec.worldbody)
    spec.add_texture(
        name='floor',
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.26, 0.32, 0.38],
        rgb2=[0.20, 0.25, 0.30],
        markrgb=[0.45, 0.50, 0.55],
        width=512,
        height=512,
    )
    # A tile is half a metre, a bright line comes every metre.
    material = spec.add_material(name='floor', texrepeat=[2, 2], texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = 'floor'
    spec.worldbody.add_geom(
        name='floor', type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], material='floor'
    )


def _room(spec: mujoco.MjSpec) -> None:
    """Build four walls, ROOM_SIZE metres apart, around the origin, and furnish it."""
    _flat(spec)
    half = ROOM_SIZE / 2.0
    thickness = 0.05
    for name, x, y in (('east', 1, 0), ('west', -1, 0), ('north', 0, 1), ('south', 0, -1)):
        spec.worldbody.add_geom(
            name=f'{name}_wall',
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[x * (half + thickness), y * (half + thickness), WALL_HEIGHT / 2.0],
            size=[
                thickness if x else half + 2.0 * thickness,
                thickness if y else half + 2.0 * thickness,
                WALL_HEIGHT / 2.0,
            ],
            rgba=WALL,
        )
    _add_furniture(spec)


def _office(spec: mujoco.MjSpec) -> None:
    """Build the office of `flats`."""
    _flat(spec)
    office = make_office()
    _build(spec, office.boxes, office.walls, float(office.size.max()))


def add_flat(spec: mujoco.MjSpec, seed: float, _: np.random.Generator) -> None:
    """Build the flat of a seed."""
    flat = make_flat(int(seed))
    _build(spec, flat.boxes, flat.walls, float(flat.size.max()))


def _build(spec: mujoco.MjSpec, boxes: np.ndarray, walls: int, size: float) -> None:
    """Build boxes like those of a `Flat`, the first of them walls, in a plan of a size [m]."""
    # Boards, not the slabs of the endless floor; and shadows wherever the robot goes.
    floor = spec.texture('floor')
    floor.rgb1, floor.rgb2, floor.markrgb = BOARDS
    spec.visual.map.shadowclip = 1.3 * min(size, LARGEST_SHADOW)
    for index, (x, y, half_length, half_width, height, yaw) in enumerate(boxes.tolist()):
        piece = index - walls
        spec.worldbody.add_geom(
            name=f'wall{index}' if piece < 0 else f'furniture{piece}',
            type=mujoco.mjtGeom.mjGEOM_BOX,
            pos=[x, y, 0.5 * height],
            size=[half_length, half_width, 0.5 * height],
            quat=[math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)],
            rgba=WALL if piece < 0 else FURNITURE[piece % len(FURNITURE)],
        )


def add_floor_plan(spec: mujoco.MjSpec, words: str) -> None:
    """
    Build the walls of a map's YAML file, or of `PICTURE,METRES_PER_PIXEL`.

    Raises:
        SimulationError: it cannot be read, or gives no world.
    """
    # Here, because few worlds are pictures.
    from wasd_core.map_picture import read_plan

    from mujoco_sim.floor_plan import make_floor_plan

    try:
        plan = read_plan(words)
        boxes, cell = make_floor_plan(plan)
    except SimulationError as error:
        raise SimulationError(f'--world {words}: {error}') from None
    except UserError as error:
        raise SimulationError(f'--world {one_line(error)}') from None
    if cell > plan.resolution:
        LOGGER.warning('--world %s: many boxes: its walls are drawn in cells of %g m', words, cell)
    _flat(spec)
    _build(spec, boxes, len(boxes), max(plan.cells.shape) * plan.resolution)


def _add_furniture(spec: mujoco.MjSpec) -> None:
    """Put something to see into each corner of the room; its middle stays free."""
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    for name, kind, place, size, rgba in (
        ('crate', box, [1.9, 1.7, 0.3], [0.3, 0.3, 0.3], [0.80, 0.45, 0.15, 1.0]),
        ('shelf', box, [-1.2, -2.4, 0.4], [0.7, 0.2, 0.4], [0.30, 0.45, 0.55, 1.0]),
        ('pillar', cylinder, [-1.6, 1.5, 0.4], [0.15, 0.4, 0.0], [0.70, 0.20, 0.20, 1.0]),
        ('bin', cylinder, [1.6, -1.8, 0.2], [0.2, 0.2, 0.0], [0.25, 0.55, 0.30, 1.0]),
    ):
        spec.worldbody.add_geom(name=name, type=kind, pos=place, size=size, rgba=rgba)


def _add_sun(body: mujoco.MjsBody) -> mujoco.MjsLight:
    light = body.add_light(
        name=SUN,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[-0.45, -0.6, 3.0],
        dir=[0.15, 0.2, -1.0],
    )
    light.diffuse = np.full(3, 0.6)
    light.castshadow = True
    return light


def lead_sun(spec: mujoco.MjSpec, body: str) -> None:
    """
    Move the sun with a body: MuJoCo draws shadows only around a light.

    A world that has no sun of ours keeps its lights as they are.
    """
    sun = spec.light(SUN)
    if sun is not None:
        spec.delete(sun)
        _add_sun(spec.body(body)).mode = mujoco.mjtCamLight.mjCAMLIGHT_TRACK


def add_slope(spec: mujoco.MjSpec, degrees: float, _: np.random.Generator) -> None:
    """Go uphill, or downhill for a negative angle, for LENGTH metres."""
    angle = math.radians(degrees)
    cos, sin = math.cos(angle), math.sin(angle)
    half = LENGTH / 2.0
    _add_box(
        spec,
        (AHEAD + half * cos + 0.5 * sin, 0.0, half * sin - 0.5 * cos),
        (half, HALF_WIDTH, 0.5),
        quaternion=(math.cos(angle / 2.0), 0.0, -math.sin(angle / 2.0), 0.0),
    )
    if degrees < 0.0:
        _end_floor(spec, AHEAD)


def add_stairs(
    spec: mujoco.MjSpec,
    rise: float,
    tread: float,
    _: np.random.Generator,
    start: float = AHEAD,
    landing: float = LANDING,
    steps: int = STEPS,
) -> None:
    """Climb steps of a rise and a tread to a landing, from x = start on [m]; then as many down."""
    for step in range(steps):
        height = rise * (step + 1)
        half = landing / 2.0 + tread * (steps - 1 - step)
        middle = start + tread * (steps - 1) + landing / 2.0
        _add_box(spec, (middle, 0.0, height / 2.0), (half, HALF_WIDTH, height / 2.0))


def add_step(spec: mujoco.MjSpec, height: float, random: np.random.Generator) -> None:
    """Step up once [m], where the seed says: each run meets the edge with another leg."""
    start = AHEAD + float(random.uniform(0.0, EDGE))
    half = LENGTH / 2.0
    _add_box(spec, (start + half, 0.0, height / 2.0), (half, HALF_WIDTH, height / 2.0))


def add_boxes(
    spec: mujoco.MjSpec,
    height: float,
    random: np.random.Generator,
    start: float = AHEAD,
    length: float = LENGTH,
) -> None:
    """Cover ground from x = start on with boxes of CELL, of random heights up to `height` [m]."""
    for row in range(round(length / CELL)):
        for column in range(round(-2.0 / CELL), round(2.0 / CELL)):
            top = float(random.uniform(0.0, height))
            if top < 0.002:
                continue
            place = (start + (row + 0.5) * CELL, (column + 0.5) * CELL, top / 2.0)
            shade = 0.75 + 0.5 * top / height
            _add_box(spec, place, (CELL / 2.0, CELL / 2.0, top / 2.0), shade=shade)


def add_rough(spec: mujoco.MjSpec, height: float, random: np.random.Generator) -> None:
    """Roll the ground smoothly, `height` [m] from trough to crest, fading in from a plane."""
    rows, columns = 80, 200
    smooth = random.normal(size=(rows, columns))
    for _ in range(6):  # repeated averaging: features of about 0.15 m
        rolled = [np.roll(smooth, shift, axis) for axis in (0, 1) for shift in (-1, 1)]
        smooth = np.mean(rolled, axis=0)
    smooth -= smooth.min()
    smooth *= np.clip(np.linspace(0.0, 8.0, columns), 0.0, 1.0) / smooth.max()
    spec.add_hfield(
        name='rough',
        size=[LENGTH / 2.0, 2.0, height, 0.1],
        nrow=rows,
        ncol=columns,
        userdata=smooth.flatten().tolist(),
    )
    spec.worldbody.add_geom(
        name='rough',
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname='rough',
        pos=[AHEAD + LENGTH / 2.0, 0.0, 0.0],
        rgba=GROUND,
    )


def add_ice(spec: mujoco.MjSpec, friction: float, random: np.random.Generator) -> None:
    """Give whatever crosses a patch of ICE_LENGTH this friction there, instead of its own."""
    start = ICE_AHEAD + float(random.uniform(0.0, EDGE))
    _end_floor(spec, start)
    ice = _add_floor(spec, start, ICE_LENGTH)
    ice.rgba = (0.72, 0.86, 0.94, 1.0)
    ice.priority = ICE_PRIORITY
    ice.friction[0] = friction
    _add_floor(spec, start + ICE_LENGTH, LENGTH)


def add_gap(spec: mujoco.MjSpec, width: float, random: np.random.Generator) -> None:
    """Cut the floor across: a pit of a width [m], PIT deep."""
    start = AHEAD + float(random.uniform(0.0, EDGE))
    _end_floor(spec, start)
    _add_floor(spec, start, width).pos[2] -= PIT
    _add_floor(spec, start + width, LENGTH)


def add_stepping(spec: mujoco.MjSpec, gap: float, random: np.random.Generator) -> None:
    """Go on over square stones of STONE, `gap` apart either way [m], in a pit."""
    start = AHEAD + float(random.uniform(0.0, EDGE))
    _end_floor(spec, start)
    apart = STONE + gap
    rows, columns = math.ceil(STONES / apart), math.ceil(2.0 / apart)
    end = start + gap + rows * apart
    _add_floor(spec, start, end - start).pos[2] -= PIT
    half = (STONE / 2.0, STONE / 2.0, PIT / 2.0)
    for row in range(rows):
        for column in range(-columns, columns + 1):
            x = start + gap + STONE / 2.0 + row * apart
            _add_box(spec, (x, column * apart, -PIT / 2.0), half)
    _add_floor(spec, end, LENGTH)


def add_course(spec: mujoco.MjSpec, seed: float, _: np.random.Generator) -> None:
    """
    Mix boxes, a step, a gap, a slope and stairs in COURSE metres, in the order of a seed.

    How high, wide and steep each is follows from the seed, too: `COURSE_SPANS`.
    """
    random = np.random.default_rng(int(seed))
    names = random.permutation(list(COURSE_SPANS)).tolist()
    sizes = {name: float(random.uniform(*span)) for name, span in COURSE_SPANS.items()}
    ways = {name: _course_way(name, sizes[name]) for name in names}
    between = (COURSE - sum(ways.values())) / len(names)
    x = floor = AHEAD
    for name in names:
        size, way = sizes[name], ways[name]
        if name == 'boxes':
            add_boxes(spec, size, random, x, way)
        elif name == 'slope':
            _add_ramps(spec, x, math.radians(size))
        elif name == 'stairs':
            add_stairs(spec, size, TREAD, random, x, COURSE_TOP, COURSE_STEPS)
        elif name == 'step':
            add_stairs(spec, size, TREAD, random, x, COURSE_TOP, 1)
        else:
            if floor == AHEAD:
                _end_floor(spec, AHEAD)
            if x > floor:
                _add_floor(spec, floor, x - floor)
            _add_floor(spec, x, way).pos[2] -= PIT
            floor = x + way
        x += way + between
    _add_floor(spec, floor, AHEAD + COURSE + LENGTH - floor)


def _course_way(name: str, size: float) -> float:
    """Return how long a part of a course is [m]."""
    if name == 'slope':
        return 2.0 * COURSE_RAMP * math.cos(math.radians(size)) + COURSE_TOP
    steps = COURSE_STEPS - 1 if name == 'stairs' else 0
    ways = {'boxes': COURSE_BOXES, 'gap': size}
    return ways.get(name, COURSE_TOP + 2.0 * TREAD * steps)


def _add_ramps(spec: mujoco.MjSpec, start: float, angle: float) -> None:
    """Add a ramp up, a landing, and a ramp down, from x = start on; steep as an angle [rad]."""
    cos, sin = math.cos(angle), math.sin(angle)
    way, height = COURSE_RAMP * cos, COURSE_RAMP * sin
    half, thick = COURSE_RAMP / 2.0, 0.05
    for sign, begin in ((1.0, start), (-1.0, start + way + COURSE_TOP)):
        middle = begin + way / 2.0 + sign * thick * sin, 0.0, (height / 2.0 - thick * cos)
        turn = (math.cos(angle / 2.0), 0.0, -sign * math.sin(angle / 2.0), 0.0)
        _add_box(spec, middle, (half, HALF_WIDTH, thick), turn)
    top = start + way + COURSE_TOP / 2.0
    _add_box(spec, (top, 0.0, height / 2.0), (COURSE_TOP / 2.0, HALF_WIDTH, height / 2.0))


def _add_floor(spec: mujoco.MjSpec, start: float, length: float) -> mujoco.MjsGeom:
    """Add a piece of floor from x = start on [m], with walls where the floor is cut."""
    half = np.array((length / 2.0, HALF_WIDTH, PIT / 2.0))
    return _add_box(spec, (start + half[0], 0.0, -half[2]), tuple(half))


def _add_box(
    spec: mujoco.MjSpec,
    position: tuple[float, float, float],
    half_size: tuple[float, float, float],
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    shade: float = 1.0,
) -> mujoco.MjsGeom:
    rgba = [shade * channel for channel in GROUND[:3]] + [1.0]
    return spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=position,
        size=half_size,
        quat=quaternion,
        rgba=np.clip(rgba, 0.0, 1.0),
    )


def _end_floor(spec: mujoco.MjSpec, x: float) -> None:
    """Let the endless floor end at x, so that it is not in the way of what goes down."""
    floor = spec.geom('floor')
    floor.type = mujoco.mjtGeom.mjGEOM_BOX
    floor.size = [3.0, HALF_WIDTH, PIT / 2.0]
    floor.pos = [x - 3.0, 0.0, -PIT / 2.0]


WORLDS: dict[str, Callable[[mujoco.MjSpec], None]] = {
    'flat': _flat,
    'room': _room,
    'office': _office,
}


class Span(NamedTuple):
    """The smallest and largest size, the default, its place in the text; some are `whole`."""

    least: float
    most: float
    usual: float = math.nan
    after: str = 'colon'
    whole: bool = False


class Terrain(NamedTuple):
    """A builder of a terrain, with a generator as last argument, and the spans of its sizes."""

    build: Callable[..., None]
    spans: tuple[Span, ...]


TERRAINS: dict[str, Terrain] = {
    'slope': Terrain(add_slope, (Span(-45.0, 45.0),)),  # degrees
    'stairs': Terrain(add_stairs, (Span(0.001, 0.5), Span(0.15, 1.0, TREAD, 'comma'))),
    'step': Terrain(add_step, (Span(0.001, 0.5),)),
    'boxes': Terrain(add_boxes, (Span(0.001, 0.5),)),
    'rough': Terrain(add_rough, (Span(0.001, 0.5),)),
    'ice': Terrain(add_ice, (Span(0.01, 2.0),)),  # friction
    'gap': Terrain(add_gap, (Span(0.001, 1.0),)),
    'stepping': Terrain(add_stepping, (Span(0.01, 0.3),)),
    'course': Terrain(add_course, (Span(0, 999_999, whole=True),)),  # a seed
    'flat': Terrain(add_flat, (Span(0, 999_999, whole=True),)),  # a seed
}
