# SPDX-License-Identifier: Apache-2.0
"""
Clones the model-based walker into a small network: our own policy.

    python benchmarks/clone_policy.py [--rounds N] [--output FILE.onnx]

DAgger [Ross2011] with numpy alone: the network drives, the leg controller says in each state what
it would have done, and the network is trained on all that was ever said. What is simulated is what
`wasd.Go2` simulates: noise, drift, delay; and more: robots that differ at random, pushes. Seeds
begin at 1000, those of the benchmark at 12000.
"""

import argparse
from pathlib import Path
import pickle
import sys
import time
from typing import Any, NamedTuple

import numpy as np
from policy_player.observations import Observer
from policy_player.onnx_writer import write_layers
from policy_player.spec import PolicySpec, Term
import wasd
from wasd_core.robot_io import JointCommand, Senses

LEGS = ('FL', 'FR', 'RL', 'RR')
JOINTS = tuple(f'{leg}_{part}_joint' for leg in LEGS for part in ('hip', 'thigh', 'calf'))
DEFAULT = (0.0, 0.8, -1.6) * 4
# The gait that is cloned: one period and duty at all speeds [s].
PERIOD, DUTY = 0.4, 0.55
RANGES = ((-0.6, 1.3), (-0.4, 0.4), (-1.0, 1.0))
SPEC = PolicySpec(
    source='ours',
    joints=JOINTS,
    stiffness=(30.0,) * 12,
    damping=(1.0,) * 12,
    default_position=DEFAULT,
    action_scale=(0.3,) * 12,
    action_offset=DEFAULT,
    terms=(
        Term(name='linear_velocity', scale=(2.0,)),
        Term(name='angular_velocity', scale=(0.5,)),
        Term(name='gravity', scale=(3.0,)),
        Term(name='command', scale=(2.0,)),
        Term(name='joint_position', scale=(2.0,)),
        Term(name='joint_velocity', scale=(0.1,)),
        Term(name='phase'),
    ),
    phase_period=PERIOD,
    ranges=RANGES,
)
EXPERT = {
    'step_in_place': True,
    'gait.slow_period': PERIOD,
    'gait.fast_period': PERIOD,
    'gait.slow_duty': DUTY,
    'gait.fast_duty': DUTY,
    'gait.haste_gain': 0.0,
}
HIDDEN = (256, 128)
EPISODE, TICKS = 24.0, 10  # seconds; ticks of the expert in a step of the network
# Beyond this tilt what the expert says is of no use [rad].
LOST = 0.8
# For so long one of the two drives before it is drawn again [steps].
SPELL = 20
FIRST_SEED = 1000


class Net(NamedTuple):
    """Weights and biases."""

    weights: list[np.ndarray]
    biases: list[np.ndarray]

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return what it says to observations (n, width)."""
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            x = x @ weight.T + bias
            x = np.where(x > 0.0, x, np.expm1(np.minimum(x, 0.0)))
        said: np.ndarray = x @ self.weights[-1].T + self.biases[-1]
        return said


def fresh(rng: np.random.Generator) -> Net:
    """Return a network that knows nothing."""
    widths = (SPEC.width, *HIDDEN, 12)
    pairs = list(zip(widths, widths[1:], strict=False))
    weights = [rng.normal(size=(b, a)).astype(np.float32) / np.sqrt(a) for a, b in pairs]
    weights[-1] *= 0.1
    return Net(weights, [np.zeros(b, np.float32) for _, b in pairs])


def train(net: Net, x: np.ndarray, y: np.ndarray, epochs: int, rng: np.random.Generator) -> float:
    """Train in place by Adam on a Huber loss; return the mean squared error in the end."""
    parts = [*net.weights, *net.biases]
    moments = [(np.zeros_like(p), np.zeros_like(p)) for p in parts]
    count, batch, step, loss = len(x), 256, 0, 0.0
    total = epochs * (count // batch)
    for _ in range(epochs):
        order, loss = rng.permutation(count), 0.0
        for start in range(0, count - batch + 1, batch):
            step += 1
            rows = order[start : start + batch]
            layers, h = [x[rows]], x[rows]
            for weight, bias in zip(net.weights[:-1], net.biases[:-1], strict=True):
                z = h @ weight.T + bias
                h = np.where(z > 0.0, z, np.expm1(np.minimum(z, 0.0)))
                layers.append(h)
            off = h @ net.weights[-1].T + net.biases[-1] - y[rows]
            loss += float((off**2).mean())
            g = np.clip(off, -1.0, 1.0) / batch
            grads_w: list[np.ndarray] = []
            grads_b: list[np.ndarray] = []
            for index in reversed(range(len(net.weights))):
                grads_w.insert(0, g.T @ layers[index])
                grads_b.insert(0, g.sum(axis=0))
                if index:
                    h = layers[index]
                    g = (g @ net.weights[index]) * np.where(h > 0.0, 1.0, h + 1.0)
            rate = 1.5e-3 * 0.5 * (1.0 + np.cos(np.pi * step / total)) + 1e-5
            for p, (m, v), grad in zip(parts, moments, [*grads_w, *grads_b], strict=True):
                m += 0.1 * (grad - m)
                v += 0.001 * (grad**2 - v)
                p -= rate * (m / (1 - 0.9**step)) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8)
    return loss / max(count // batch, 1)


class Episode:
    """One drive of the expert, or of the network with the expert beside it."""

    def __init__(
        self, seed: int, net: Net | None, level: float, share: float, hard: float
    ) -> None:
        self.rng = np.random.default_rng(seed)
        self.dog = wasd.Go2(seed=seed, untold=wasd.Untold(randomise=hard * level))
        self.robot: Any = self.dog._robot
        legs = self.robot.legs
        legs.tune(legs.settings.changed(EXPERT))
        self.net, self.observer, self._share = net, Observer(SPEC), share
        self._hard = hard
        self._usual_control = self.robot.control
        self._is_expert = True
        self.shown: list[np.ndarray] = []
        self.said: list[np.ndarray] = []
        self._wanted: list[np.ndarray] = []
        self._tick = 0
        self._action = np.zeros(12)
        self._bias = np.zeros(3)

    def run(self) -> int:
        """Stand and drive, again after each fall; return how often it fell."""
        left, falls = EPISODE, 0
        while left > 0.0:
            self._begin()
            drove, fell = self._drive(left)
            left, falls = left - drove - 1.0, falls + fell
        return falls

    def _begin(self) -> None:
        dog, robot = self.dog, self.robot
        robot.control = self._usual_control
        dog.reset()
        dog.press('2')
        dog.run(2.2)
        dog.press('5')
        dog.run(0.01)
        del self.shown[len(self.said) :]
        self._tick, self._wanted, self._action = 0, [], np.zeros(12)
        robot.control = self._control

    def _drive(self, left: float) -> tuple[float, bool]:
        """Drive until it falls, or for so long; return how long [s], and whether it fell."""
        dog, rng, drove = self.dog, self.rng, 0.0
        push_at = rng.uniform(1.5, 4.0)
        while drove < left:
            dog.drive(*self._command())
            span = rng.uniform(1.0, 3.0)
            for _ in range(round(span / 0.1)):
                dog.run(0.1)
                drove, push_at = drove + 0.1, push_at - 0.1
                if dog.state != 'move base' or dog.truth.tilt > LOST:
                    return drove, True
                if push_at < 0.0:
                    size = self._hard * rng.uniform(60.0, 280.0)
                    dog.push((size * self._direction()).tolist(), 0.1)
                    push_at = rng.uniform(1.5, 4.0)
        return drove, False

    def _direction(self) -> np.ndarray:
        """Return where to push, (3,): to a side in the dog's axes, or anywhere."""
        rng, yaw = self.rng, float(self.dog.truth.rpy[2])
        side = yaw + rng.choice((-0.5, 0.5)) * np.pi + rng.normal(scale=0.2)
        angle = side if rng.uniform() < 0.6 else rng.uniform(-np.pi, np.pi)
        return np.array((np.cos(angle), np.sin(angle), 0.0))

    def _command(self) -> tuple[float, float, float]:
        rng, kind = self.rng, self.rng.uniform()
        if kind < 0.12:
            return 0.0, 0.0, 0.0
        vx, vy, wz = (float(rng.uniform(*ends)) for ends in RANGES)
        if kind < 0.45:
            return max(vx, 0.2), 0.0, 0.0
        if kind < 0.6:
            return 0.0, 0.0, wz
        if kind < 0.7:
            return 0.0, vy, 0.0
        return vx, vy if kind < 0.85 else 0.0, wz

    def _control(self) -> None:
        robot, world = self.robot, self.robot.world
        reading = world.read()
        names = world.joint_names, world.motor_names
        command = robot.legs.control(reading, *names, robot.period)
        q, dq = reading.joints.position, reading.joints.velocity
        torque = command.effort + command.kp * (command.position - q)
        torque = torque + command.kd * (command.velocity - dq)
        kp, kd = np.array(SPEC.stiffness), np.array(SPEC.damping)
        self._wanted.append((q + (torque + kd * dq) / kp - DEFAULT) / SPEC.action_scale)
        if self._tick % TICKS == 0:
            self._label()
            self._observe(reading)
        self._tick += 1
        if self.net is None or self._is_expert:
            world.apply(command)
        else:
            target = np.array(DEFAULT) + np.array(SPEC.action_scale) * self._action
            world.apply(JointCommand(target, np.zeros(12), np.zeros(12), kp, kd))

    def _label(self) -> None:
        """Say of the last observation what the expert wanted after it, on average."""
        if self.shown and len(self.said) < len(self.shown):
            self.said.append(np.mean(self._wanted[:TICKS], axis=0))
        self._wanted = self._wanted[-1:]

    def _observe(self, reading: Any) -> None:
        legs = self.robot.legs.controller
        state, gait = legs.robot, legs.locomotion.gait
        self._bias += 0.1 * (self.rng.normal(scale=0.06, size=3) - self._bias)
        velocity = state.base.velocity @ state.base.R + self._bias
        velocity = velocity + self.rng.normal(scale=0.03, size=3)
        senses = Senses(
            state.orientation.copy(), state.base.omega.copy(), velocity,
            reading.joints.position, reading.joints.velocity,
        )  # fmt: skip
        self.observer._steps = round(gait._phase * PERIOD / SPEC.period * 1e6) / 1e6
        shown = self.observer.step(senses, legs.command_filter.command, self._action)
        if len(self.shown) % SPELL == 0:
            self._is_expert = bool(self.rng.uniform() < self._share)
        self.shown.append(shown)
        if self.net is not None:
            self._action = self.net(shown[None]).ravel().astype(float)


def main() -> None:
    """Clone, round by round."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=8)
    parser.add_argument('--episodes', type=int, default=8)
    parser.add_argument('--epochs', type=int, default=40)
    parser.add_argument('--level', type=float, default=0.4)
    parser.add_argument('--polish', type=int, default=0, help='epochs, without driving')
    parser.add_argument('--start', type=Path, help='data of an earlier run')
    parser.add_argument('--output', type=Path, default=Path('ours.onnx'))
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    net: Any = None
    xs: list[np.ndarray] = []
    ys: list[np.ndarray] = []
    first = 0
    if options.start:
        xs, ys, net, first = pickle.loads(options.start.read_bytes())  # our own
    if options.polish:
        x, y = np.concatenate(xs), np.concatenate(ys)
        print(f'error {train(net, x, y, options.polish, rng):.4f} of {len(x)} frames')
        write_layers(options.output, SPEC, list(zip(net.weights, net.biases, strict=True)))
        return
    for number in range(first, first + options.rounds):
        begun, falls, frames = time.monotonic(), 0, 0
        share = max(0.0, 0.6 - 0.15 * number)
        hard = min(max(0.2 * (number - 2), 0.05), 1.0)
        for index in range(options.episodes):
            seed = FIRST_SEED + 100 * number + index
            episode = Episode(seed, net, options.level, share, hard)
            falls += episode.run()
            count = len(episode.said)
            xs.append(np.array(episode.shown[:count], np.float32))
            ys.append(np.clip(np.array(episode.said, np.float32), -8.0, 8.0))
            frames += count
        drove = time.monotonic() - begun
        x, y = np.concatenate(xs), np.concatenate(ys)
        net = net or fresh(rng)
        loss = train(net, x, y, options.epochs, rng)
        took = time.monotonic() - begun
        print(
            f'round {number}: {falls} falls in {options.episodes} episodes, '
            f'{frames} new frames of {len(x)}, '
            f'error {loss:.4f}, {drove:.0f} s + {took - drove:.0f} s',
            flush=True,
        )
        write_layers(options.output, SPEC, list(zip(net.weights, net.biases, strict=True)))
        options.output.with_suffix('.data').write_bytes(pickle.dumps((xs, ys, net, number + 1)))
    sys.exit(0)


if __name__ == '__main__':
    main()
