# SPDX-License-Identifier: Apache-2.0
"""Every number has two ends; inside them robots go on, outside is refused, by ROS and by file."""

from collections.abc import Callable
from dataclasses import replace
import importlib
import math
from pathlib import Path
import random
from typing import Any

from cases import for_all
from diff_drive_sim.controller_file import read_controller_file
from diff_drive_sim.parameters import DiffDriveParameters
import pytest
from quadruped_sim.parameters import LegNodeParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
import wasd
from wasd_core.errors import UserError
from wasd_core.parameter_file import NodeKind, read_parameters
from wasd_core.parameters import known_parameters, numeric_ends, Parameters
import yaml

pytestmark = pytest.mark.long

ROOT = Path(__file__).resolve().parents[2]
HOMES = (
    *('diff_drive_sim', 'mujoco_sim', 'policy_player', 'quadruped_sim'),
    *('robot_description', 'teleop_keyboard', 'wasd_navigation'),
)
NONSENSE = (
    0.0,
    -1.0,
    5e-324,
    1e308,
    math.nan,
    math.inf,
    10**400,
    True,
    '',
    'x',
    [],
    [1.0],
    None,
    {},
)


def sets_of(home: str) -> list[type[Parameters]]:
    """Return the parameter sets of a package."""
    kinds = vars(importlib.import_module(f'{home}.parameters')).values()
    return [
        kind
        for kind in kinds
        if isinstance(kind, type) and issubclass(kind, Parameters) and kind is not Parameters
    ]


def is_number(default: Any) -> bool:
    """Whether a parameter is a number or a list of them."""
    items = default if isinstance(default, tuple) else (default,)
    return bool(items) and all(type(item) in (int, float) for item in items)


def flat(value: Any) -> tuple[float, ...]:
    return value if isinstance(value, tuple) else (value,)


@for_all('home', HOMES)
def test_every_number_has_two_finite_ends_and_none_is_the_least_there_is(home: str) -> None:
    for kind in sets_of(home):
        for name, (field, _) in known_parameters(kind).items():
            # A set itself takes its defaults as they are.
            assert repr(kind.checked(name, field.default)) == repr(field.default)
            if not is_number(field.default):
                continue
            low, high = map(flat, numeric_ends(field))
            assert all(map(math.isfinite, (*low, *high))), name
            assert all(abs(end) > 1e-9 or end == 0.0 for end in (*low, *high)), name
            for least, value, most in zip(low, flat(field.default), high, strict=True):
                assert math.isnan(value) or least <= value <= most, name


@pytest.fixture
def ask(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the list of all nodes that the programs run."""
    pytest.importorskip('tf2_msgs')
    monkeypatch.syspath_prepend(str(ROOT / 'docs'))
    return importlib.import_module('ask_nodes')


@pytest.fixture
def bounds(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return the experiment of the benchmarks that found the ranges."""
    monkeypatch.syspath_prepend(str(ROOT / 'benchmarks'))
    return importlib.import_module('parameter_bounds')


@pytest.mark.slow
def test_ros_tells_the_ends_of_every_number_takes_them_and_refuses_what_is_outside(
    ask: Any, bounds: Any, ros: Any
) -> None:
    """
    By the callbacks that `ros2 param set` calls, on every node, which goes on.

    Ends, the least number above 0, words and lists.
    """
    asked = numbers = 0
    for make_node, home in ask.NODES.items():
        node = make_node()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        fields = {n: k.field for kind in sets_of(home) for n, k in known_parameters(kind).items()}
        for name in node.get_parameters_by_prefix(''):
            descriptor = node.describe_parameter(name)
            ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
            if descriptor.read_only:
                continue
            kept = before = node.get_parameter(name)
            ends = [end for each in ranges for end in (each.from_value, each.to_value)]
            more = bounds.ends_of(fields[name]).values() if name in fields else ()
            for value in dict.fromkeys((*ends, *more)):
                wanted = list(value) if isinstance(value, tuple) else value
                (taken,) = node.set_parameters([Parameter(name, value=wanted)])
                executor.spin_once(timeout_sec=0.001)
                # A preset may have a range of its own within it.
                refusal = 'must be within' if value in ends else 'must'
                assert taken.successful or refusal in taken.reason
                assert '\n' not in taken.reason
                kept = Parameter(name, value=wanted) if taken.successful else kept
                assert repr(node.get_parameter(name).value) == repr(kept.value), name
                asked += 1
            node.set_parameters([before])
            if not ranges:
                continue
            numbers += 1
            step = 1 if isinstance(before.value, int) else 0.01 * (ends[1] - ends[0])
            for outside in (ends[0] - step, ends[1] + step):
                (refused,) = node.set_parameters([Parameter(name, value=outside)])
                assert not refused.successful, f'{name} = {outside}'
                assert name in refused.reason
                assert 'Max' in refused.reason or '<=' in refused.reason
                assert node.get_parameter(name).value == before.value
        executor.remove_node(node)
        node.destroy_node()
    assert numbers > 100
    assert asked > 500


@for_all('home', HOMES)
def test_a_number_that_0_leaves_to_others_is_not_next_to_0(home: str) -> None:
    for kind in sets_of(home):
        for name, (field, _) in known_parameters(kind).items():
            if not field.metadata['or_zero']:
                continue
            assert kind.checked(name, 0.0) == 0.0
            assert kind.checked(name, 0) == 0.0
            least = field.metadata['minimum']
            assert kind.checked(name, least) == least > 0.0
            for value in (math.ulp(0.0), 0.99 * least, -0.01):
                with pytest.raises(UserError, match=rf'{name} must be 0, or >= {least:g} and <='):
                    kind.checked(name, value)


def drawn(definition: type[Parameters], chance: random.Random) -> dict[str, Any]:
    """Return some parameters, each in its range, or now and then nonsense."""
    known, values = known_parameters(definition), {}
    for name in chance.sample(sorted(known), chance.randint(1, 12)):
        field = known[name].field
        values[name] = _value(field, chance) if chance.random() < 0.9 else chance.choice(NONSENSE)
    return values


def _value(field: Any, chance: random.Random) -> Any:
    if is_number(field.default):
        low, high = map(flat, numeric_ends(field))
        kind = chance.randint if isinstance(field.default, int) else chance.uniform
        items = [kind(*ends) for ends in zip(low, high, strict=True)]  # type: ignore[operator]
        return items if isinstance(field.default, tuple) else items[0]
    if isinstance(field.default, bool):
        return chance.random() < 0.5
    return chance.choice(tuple(field.metadata['choices']) or (field.default,))


def as_yaml(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def read_legs(path: str) -> Any:
    return read_parameters(path, LegNodeParameters, NodeKind('leg_controller', 'leg controller'))


def read_wheels(path: str) -> Any:
    return read_controller_file(path).values


@pytest.mark.slow
def test_wheels_drive_by_any_file_that_loads(tmp_path: Path) -> None:
    path, driven = tmp_path / 'drawn.yaml', 0
    for seed in range(60):
        values = drawn(DiffDriveParameters, random.Random(1000 + seed)) | {'mode': 'float'}
        values.pop('legacy', None)
        path.write_text(yaml.safe_dump(values))
        try:
            robot = wasd.Mbot(seed=seed, controller=path)
        except UserError as error:
            assert '\n' not in str(error)
            continue
        robot.drive(0.3, 0.5)
        robot.run(0.5)
        assert all(map(math.isfinite, (*robot.odometry[:3], *robot.truth.position))), values
        driven += 1
    assert driven > 15


@pytest.mark.slow
@pytest.mark.parametrize(
    ('read', 'definition'),
    [(read_legs, LegNodeParameters), (read_wheels, DiffDriveParameters)],
    ids=['legs', 'wheels'],
)
def test_a_file_takes_both_ends_of_every_number_and_nothing_outside(
    read: Callable[[str], Any], definition: type[Parameters], tmp_path: Path
) -> None:
    asked, path = 0, tmp_path / 'parameters.yaml'
    for name, (field, _) in known_parameters(definition).items():
        if not is_number(field.default):
            continue
        for end, sign in zip(numeric_ends(field), (-1, 1), strict=True):
            path.write_text(yaml.safe_dump({name: as_yaml(end)}))
            assert read(str(path)) == {name: end}
            beyond = tuple(item + sign * max(1.0, 0.01 * abs(item)) for item in flat(end))
            outside = type(flat(end)[0])(beyond[0]) if not isinstance(end, tuple) else beyond
            path.write_text(yaml.safe_dump({name: as_yaml(outside)}))
            with pytest.raises(UserError) as caught:
                read(str(path))
            assert name in str(caught.value)
            assert '\n' not in str(caught.value)
            asked += 1
    assert asked > 30


@pytest.mark.slow
def test_the_go2_trots_on_while_each_parameter_goes_to_both_its_ends(bounds: Any) -> None:
    """
    One walk, 0.06 s at each end; by itself each is tried for longer in the benchmark.

    A parameter goes back to its default as the next one leaves it.
    """
    time, tunes = 1.8, []
    for name, known in bounds.KNOWN.items():
        ends = [value for what, value in bounds.ends_of(known.field).items() if '[' not in what]
        default = known.field.default
        for value in ends:
            tunes.append((round(time, 3), name, value))
            time += 0.06
        tunes.append((round(time, 3), name, default))
    run = bounds.Run(
        seed=7,
        keys='0.1 2\n1.1 5\n',
        twist='1.2 0.5 0 0.5\n7 1.0 0 0.6\n',
        duration=time,
        tunes=tuple(tunes),
    )
    assert bounds.judged(run) == ''


@pytest.mark.slow
@pytest.mark.parametrize('seed', range(2))
def test_no_set_of_parameters_within_their_ranges_ends_it_or_makes_nan(
    bounds: Any, seed: int
) -> None:
    ((_, run),) = bounds.sets(1, seed)
    # The benchmark's walk in half its time; one that has fallen gets up with them, too.
    run = replace(
        run,
        keys='0.1 2\n1.1 5\n3.4 2\n4.2 2\n',
        twist='1.2 0.5 0 0.8\n2.0 1.0 0 1.0\n3.2 0 0 0\n',
        tunes=tuple((1.6, name, value) for _, name, value in run.tunes),
        duration=5.3,
    )
    assert 'BROKE' not in bounds.judged(run)


@for_all(
    ('read', 'text', 'message'),
    [
        (
            read_legs,
            'gait: {slow_period: 0.4}\ngait.slow_period: 0.5\n',
            ":2: 'gait.slow_period' is there twice",
        ),
        (
            read_controller_file,
            'wheel_separation: 0.3\nbase_width: 0.26\n',
            ":2: 'base_width' is there twice, as 'wheel_separation'",
        ),
    ],
)
def test_a_value_that_another_would_replace_in_silence_is_refused(
    read: Callable[[str], Any], text: str, message: str, tmp_path: Path
) -> None:
    path = tmp_path / 'twice.yaml'
    path.write_text(text)
    with pytest.raises(UserError) as caught:
        read(str(path))
    assert str(caught.value) == f'{path}{message}'


def test_a_list_takes_numbers_as_people_write_them(tmp_path: Path) -> None:
    path = tmp_path / 'list.yaml'
    path.write_text('balance.position_gains: [6e1, 60, 8.0e1]\n')
    assert read_legs(str(path)) == {'balance.position_gains': (60.0, 60.0, 80.0)}
