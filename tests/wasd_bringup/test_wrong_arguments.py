# SPDX-License-Identifier: Apache-2.0
"""Wrong values given to `import wasd`: each is a UserError of one line, whichever function."""

from collections.abc import Callable
import copy
import itertools
from pathlib import Path
import re
from typing import Any

from cases import for_all
from descriptions import robot_named
import numpy as np
import pytest
import wasd

pytestmark = pytest.mark.slow

NAN = float('nan')
OF_ANY_ROBOT: tuple[dict[str, Any], ...] = (
    {'world': 5},
    {'world': None},
    {'seed': '1'},
    {'seed': -1},
    {'seed': 1 << 63},
    {'description': None},
    {'package_path': 'abc'},
    {'package_path': ['/nowhere']},
)
OF_ONE: tuple[tuple[str, dict[str, Any]], ...] = (
    ('Go2', {'policy': 5}),
    ('Go2', {'policy': object()}),
    ('Go2', {'policy_config': 5}),
    ('Go2', {'height_scan': 'x'}),
    ('Go2', {'height_scan': None}),
    ('Go2', {'estimator': 'x'}),
    ('Go2', {'limits': None}),
    ('Go2', {'gait': 5}),
    ('Go2', {'eyes': 'no'}),
    ('Go2', {'untold': {'friction': 0.5}}),
    ('Go2', {'xacro_arguments': {'camera': 5}}),
    ('G1', {'policy': 5}),
    ('G1', {'untold': 5}),
    ('Mbot', {'preset': 5}),
    ('Mbot', {'preset': 'unitree'}),
    ('Mbot', {'controller': 5}),
    ('Mbot', {'controller': ''}),
    ('Mbot', {'xacro_arguments': 5}),
)
UNTOLD: tuple[dict[str, Any], ...] = (
    {'payload': 3},
    {'payload': (3.0, (0.0, 0.0, 0.0))},
    {'payload': wasd.Payload(3.0, (0.0, 0.0))},  # type: ignore[arg-type]
    {'payload': wasd.Payload('3')},  # type: ignore[arg-type]
    {'friction': 'x'},
    {'friction': NAN},
    {'randomise': None},
    {'imu_drift': '1'},
)
VERBS: tuple[Callable[[Any], Any], ...] = (
    lambda robot: robot.push('abc', 1.0),
    lambda robot: robot.push(5, 1.0),
    lambda robot: robot.push((1.0, 2.0), 1.0),
    lambda robot: robot.push((1.0, 2.0, NAN), 1.0),
    lambda robot: robot.push((1.0, 2.0, 3.0), 'x'),
    lambda robot: robot.push((1.0, 2.0, 3.0), 0.0),
    lambda robot: robot.push((1.0, 2.0, 3.0), 1e308),
    lambda robot: robot.push((1.0, 2.0, 3.0), 1.0, 'abc'),
    lambda robot: robot.drive('1', 0.0),
    lambda robot: robot.drive(NAN),
    lambda robot: robot.drive(1j),
    lambda robot: robot.drive(0.1, [1.0]),
    lambda robot: robot.run('x'),
    lambda robot: robot.run(-1.0),
    lambda robot: robot.run(1e308),
    lambda robot: robot.press(5),
    lambda robot: robot.press(''),
    lambda robot: robot.picture(5),
    lambda robot: robot.picture(''),
)


def refused(call: Callable[[], Any]) -> str:
    """Return the line with which a call is refused."""
    with pytest.raises(wasd.UserError) as caught:
        call()
    said = str(caught.value)
    assert '\n' not in said
    assert re.search(r'got|no such|unknown', said), said
    return said


@for_all(
    ('kind', 'given'),
    [*itertools.product(('Go2', 'Mbot', 'G1'), OF_ANY_ROBOT), *OF_ONE],
)
def test_a_robot_refuses_a_wrong_option_by_its_name(kind: str, given: dict[str, Any]):
    (name,) = given
    said = refused(lambda: getattr(wasd, kind)(**given))
    assert name in said


@for_all('given', UNTOLD)
def test_what_is_untold_is_checked_by_its_name(given: dict[str, Any]):
    (name,) = given
    assert refused(lambda: wasd.Untold(**given)).startswith(name)


@pytest.mark.parametrize('kind', ['Go2', 'Mbot', 'G1'])
def test_every_verb_refuses_wrong_values_and_the_robot_goes_on(kind: str):
    robot = getattr(wasd, kind)()
    for verb in VERBS:
        refused(lambda verb=verb: verb(robot))
    robot.run(0.1)
    assert robot.time == pytest.approx(0.1)


def test_a_robot_refuses_to_be_copied():
    car = wasd.Mbot()
    with pytest.raises(wasd.UserError, match='^Mbot cannot be copied or pickled: make another$'):
        copy.deepcopy(car)


def test_numbers_of_numpy_are_numbers():
    car = wasd.Mbot(seed=np.int64(3))
    car.drive(np.float32(0.25), np.array(0.0))
    car.push(np.array([1.0, 0.0, 0.0]), np.float64(0.1))
    car.run(np.float32(0.5))
    assert car.truth.position[0] > 0.02


def test_a_file_may_be_a_path_and_an_argument_of_xacro_empty(tmp_path: Path):
    path = tmp_path / 'cart.urdf.xacro'
    path.write_text(robot_named('mbot').urdf)
    car = wasd.Mbot(description=path, world=Path('flat'), xacro_arguments={'prefix': ''})
    car.run(0.1)
    assert car.time == pytest.approx(0.1)


def test_an_update_rate_between_physics_steps_is_named_with_one_that_fits(tmp_path: Path):
    (path := tmp_path / 'controller.yaml').write_text('update_rate: 156.5\n')
    said = refused(lambda: wasd.Mbot(controller=path))
    assert said.startswith('update_rate: got 156.5 Hz, which does not fit the physics step')
    assert said.endswith('; 200 Hz does')


def test_the_environment_refuses_wrong_values():
    pytest.importorskip('gymnasium')
    from wasd.environment import Go2Environment

    makes: tuple[dict[str, Any], ...] = (
        {'world': 5},
        {'randomise': 'x'},
        {'randomise': 2.0},
        {'noise': 'x'},
        {'heights': 5},
        {'command': (1.0, 2.0)},
        {'command': (1.0, 2.0, NAN)},
        {'render_mode': 'x'},
    )
    for given in makes:
        assert next(iter(given)) in refused(lambda given=given: Go2Environment(**given))
    env = Go2Environment()
    with pytest.raises(wasd.UserError, match='call reset first'):
        env.step(np.zeros(12))
    assert refused(lambda: env.reset(seed=-1)).startswith('reset: seed: got -1')
    options: tuple[Any, ...] = (5, {'command': 'abc'}, {'command': (1, 2, NAN)}, {'comand': 5})
    options += ({5: 5}, {None: 5})
    for given in options:
        assert refused(lambda given=given: env.reset(options=given)).startswith('reset: ')
    assert 'did you mean command?' in refused(lambda: env.reset(options={'comand': (0, 0, 0)}))
    env.reset(seed=1, options={'command': np.zeros(3)})
    actions = (np.zeros(11), np.zeros((12, 1)), np.full(12, NAN), 'abc', None)
    for action in actions:
        said = refused(lambda action=action: env.step(action))
        assert said.endswith(', wanted 12 finite numbers')
    env.step(np.zeros(12, np.float32))


def test_the_environment_takes_a_world_by_its_path_and_seeds_of_numpy():
    pytest.importorskip('gymnasium')
    from wasd.environment import Go2Environment

    env = Go2Environment(Path('flat'))
    first, _ = env.reset(seed=3)
    second, _ = env.reset(seed=np.int64(3))
    np.testing.assert_array_equal(first, second)
