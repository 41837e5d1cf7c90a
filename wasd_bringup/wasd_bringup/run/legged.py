# SPDX-License-Identifier: Apache-2.0
"""A robot of a run that walks by a policy: on a hoist or free, it stands, walks, falls."""

from mujoco_sim.hoist import Hoist
from mujoco_sim.simulation import Simulation
from mujoco_sim.viewer.camera import CameraView
from mujoco_sim.world import World
from policy_player.joint_controller import JointController, Means, State, STATE_KEYS
from policy_player.loading import load_policy
from policy_player.stands import g1_stand, is_g1, stand_of
from robot_description.description import Description
from robot_description.robot import Robot as RobotTree
from teleop_keyboard.dashboard import driving_keys, Status
from teleop_keyboard.keymap import on_qwerty
from teleop_keyboard.keys_to_twist import KeysToTwist
from wasd_cockpit.link import Choice
from wasd_core.errors import UserError
from wasd_core.robot_io import JointStates, LEG_RATE, Reading
from wasd_core.timing import is_press, Notice, STOP_KEY

from wasd_bringup.run.inputs import RESET_KEY
from wasd_bringup.run.options import RunOptions
from wasd_bringup.run.report import Sample
from wasd_bringup.run.robot import axes_of, Robot, Velocity

HOIST_KEY, HOIST = 'h', 'hoist'
PASSIVE = next(key for key, state in STATE_KEYS.items() if state is State.PASSIVE)


class Legged(Robot):
    """
    Legs and arms with PD control: of a pose, or of a network's targets.

    A hoist bears it from the start on.

    Raises:
        UserError: no network walks it and its stand is not known, the network is another
            robot's, or the keymap has a key of a state or of the hoist.
    """

    has_states = True
    has_odometry = False
    estimator = 'imu'
    period = 1.0 / LEG_RATE
    camera = CameraView(distance=3.8, azimuth=130.0, elevation=-12.0)
    logic: KeysToTwist  # whatever the preset

    def __init__(
        self, options: RunOptions, loaded: Description, world: World, simulation: Simulation
    ) -> None:
        super().__init__(options, loaded, world, simulation)
        for key in (*STATE_KEYS, HOIST_KEY):
            if self.named(key) in self.own_keys:
                raise UserError(
                    f'--preset {options.preset}: {self.name} needs the key {self.named(key)} '
                    f'itself ({STATE_KEYS.get(key, HOIST)}): take another preset'
                )
        player = load_policy(options.policy, options.policy_config, loaded.robot)
        joints = world.motor_names
        self.controller = JointController(joints, stand_of(loaded, joints, player), player)
        self.controller.means = Means('--policy FILE', self.named(HOIST_KEY), RESET_KEY)
        self.hoist = Hoist(world)
        self.notice = Notice()
        self._refused = ''

    @property
    def state(self) -> str:
        """The controller's state."""
        return self.controller.state.value

    @property
    def help_lines(self) -> tuple[str, ...]:
        """The keys, for the terminal and the page."""
        return (*self.kind.state_help, *self.logic.keymap.help_lines)

    @property
    def first_keys(self) -> str:
        """The keys to press first."""
        walk = f', {self.named("p")} to walk' if self.controller.has_policy else ''
        return (
            f'press 2 to stand{walk}, {self.named(HOIST_KEY)} to let go of the hoist; then '
            f'{driving_keys(self.logic.keymap)} (forward, back, left, right)'
        )

    @property
    def stop_keys(self) -> tuple[str, ...]:
        """The keys that stop it and end every motion."""
        return (self.named(PASSIVE), STOP_KEY)

    @property
    def _refusal(self) -> str:
        if self.controller.state is State.POLICY:
            return ''
        return self.controller.refusal('p') or f'press p to walk: it is {self.state}'

    def choices(self) -> tuple[Choice, ...]:
        """Return the states with keys, and the hoist."""
        controller = self.controller
        states = [
            Choice(state.value, key, state is controller.state, controller.refusal(key))
            for key, state in STATE_KEYS.items()
        ]
        return (*states, Choice(HOIST, HOIST_KEY, self.hoist.is_on))

    def command(self, velocity: Velocity, age: float = 0.0) -> None:
        """Give the controller a velocity [m/s], [m/s], [rad/s] of any source."""
        refused = self.controller.command(velocity)
        # Once: velocities come twenty times a second, and would hide the answers to keys.
        if refused and refused != self._refused:
            self._answer(refused)
        self._refused = refused

    def control(self) -> None:
        """Step the controller on the present state, and give its command to the world."""
        world, motors = self.world, self.world.parts.motor_joint
        joints, imu = world.read()
        reading = Reading(JointStates(*(part[motors] for part in joints)), imu)
        world.apply(self.controller.step(reading, self.period))
        if remark := self.controller.take_remark():
            self._answer(remark)
        self.hoist.step(self.period)

    def press_state(self, key: str) -> None:
        """Handle a key of a state or of the hoist."""
        name = on_qwerty(key, self.options.layout)
        if not is_press(key):
            return
        if name in STATE_KEYS:
            self._answer(self.controller.press(name))
        elif name == HOIST_KEY and self.hoist.is_on:
            self.hoist.let_go()
            self.say('the hoist has let go')
        elif name == HOIST_KEY:
            self.hoist.take()
            self.say('the hoist holds it')

    def let_go(self, why: str = 'emergency stop') -> None:
        """Be limp at once."""
        self.controller.let_go(f'{why}: motors damp')

    def reset(self) -> None:
        """Forget the past: passive, on the hoist, at the start."""
        super().reset()
        self.controller.reset()
        self.hoist.reset()
        self.notice.say(None)

    def close(self) -> None:
        """Leave the joints limp."""
        self.controller.let_go()
        super().close()

    def sample(self) -> Sample:
        """Return the present sample of the report."""
        vx, vy, wz = self.controller.velocity.tolist()
        return Sample(self.state, (vx, vy, wz), (0.0, 0.0, 0.0), [], self.controller.is_fallen)

    def _status(self) -> Status:
        controller = self.controller
        vx, vy, wz = controller.velocity.tolist()
        facts = ('on the hoist',) * self.hoist.is_on
        if controller.state is State.POLICY:
            facts = (*facts, f'command {vx:+.2f} {vy:+.2f} m/s {wz:+.2f} rad/s')
        measured = self.world.base().planar_velocity.tolist()
        axes = axes_of((vx, vy, wz), measured, controller.full)
        state = 'fallen' if controller.is_fallen else self.state
        return Status(state, facts, self.notice.text, axes)

    def _answer(self, words: str) -> None:
        """Tell the driver; in the log, too, where that breaks no status line."""
        self.notice.say(words)
        if words and not self.options.interactive:
            self.log.warning('%s: %s', self.name, words)

    def _press(self, key: str, is_pressed: bool) -> None:
        if is_pressed or key == self.named(PASSIVE):
            self.press_state(key)
        super()._press(key, is_pressed)


def standing_pose(robot: RobotTree) -> dict[str, float]:
    """Return the joints at the start [rad]: a G1 stands, others are as near to zero."""
    names = [joint.name for joint in robot.movable_joints if not joint.mimics]
    if is_g1(names):
        return dict(zip(names, g1_stand(names).position.tolist(), strict=True))
    return robot.rest_positions
