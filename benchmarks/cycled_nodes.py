# SPDX-License-Identifier: Apache-2.0
"""Every node made, spun for a moment and destroyed in one process, again and again."""

from collections.abc import Callable
import ctypes
import gc
from importlib import import_module
import os
from pathlib import Path
import re
from typing import Any, NamedTuple

from environment import together

NODES = {
    'key_publisher': 'teleop_keyboard.key_publisher_node:KeyPublisherNode',
    'keys_to_twist': 'teleop_keyboard.keys_to_twist_node:KeysToTwistNode',
    'teleop': 'teleop_keyboard.teleop_node:Teleop',
    'twist_mux': 'teleop_keyboard.twist_mux_node:TwistMuxNode',
    'state_publisher': 'robot_description.state_publisher_node:StatePublisherNode',
    'simulator': 'mujoco_sim.simulator_node:SimulatorNode',
    'diff_drive_controller': 'diff_drive_sim.diff_drive_controller_node:DiffDriveControllerNode',
    'leg_controller': 'quadruped_sim.leg_controller_node:LegControllerNode',
}


class Held(NamedTuple):
    """What a process holds: memory [kB], threads, descriptors."""

    memory: int
    threads: int
    descriptors: int


def held_by(pid: int) -> Held:
    """
    Return what a process holds now.

    Raises:
        ProcessLookupError: it has ended.
    """
    status = Path(f'/proc/{pid}/status').read_text()
    if 'VmRSS' not in status:  # it has ended, and nobody has waited for it
        raise ProcessLookupError(pid)
    memory, threads = (
        int(re.search(rf'^{name}:\s+(\d+)', status, re.MULTILINE)[1])  # type: ignore[index]
        for name in ('VmRSS', 'Threads')
    )
    return Held(memory, threads, len(list(Path(f'/proc/{pid}/fd').iterdir())))


def repeat_node(name: str, times: int, turn: int | None = None) -> list[Held]:
    """
    Make and destroy a node so often, each time with a ROS of its own; return what is held.

    That is what is left for good: garbage is collected, and what glibc keeps of free memory for
    the next time (up to 10 MB more or less where a model of some MB comes and goes) given back.
    """
    os.environ.update(together(turn))
    module, _, what = NODES[name].partition(':')
    make = getattr(import_module(module), what)
    cycle = _cycle_teleop if name == 'teleop' else _cycle_node
    holds = []
    for _ in range(times):
        cycle(make)
        gc.collect()
        ctypes.CDLL(None).malloc_trim(0)
        holds.append(held_by(os.getpid()))
    return holds


def _cycle_node(make: Callable[[], Any]) -> None:
    import rclpy
    from wasd_core.node import init_ros, MessagePump

    init_ros([])
    node, pump = make(), MessagePump()
    pump.add_node(node)
    pump.handle(0.02)
    pump.shutdown(timeout_sec=0.0)
    node.close()
    node.destroy_node()
    rclpy.shutdown()


def _cycle_teleop(make: Callable[[Any], Any]) -> None:
    import rclpy
    from teleop_keyboard.key_reader import KeyReader
    from teleop_keyboard.screen import Screen
    from teleop_keyboard.terminal import Source
    from wasd_core.node import init_ros

    init_ros([])
    reading, writing = os.pipe()
    os.write(writing, b'w')
    os.close(writing)
    with open(os.devnull, 'w') as screen, KeyReader(None, Source(reading)) as reader:
        teleop = make(reader)
        teleop.keys.publish_key(reader.poll(0.02)[0])
        teleop._executor.handle(0.02)
        teleop._show(Screen(screen))
        teleop.close()
    os.close(reading)
    rclpy.shutdown()
