# SPDX-License-Identifier: Apache-2.0
"""The cockpit's view of a robot with a joint policy: buttons for states and hoist."""

from policy_player.joint_controller import State
from wasd_cockpit.link import StickUse

from wasd_bringup.page.robot_view import RobotView


class LeggedView(RobotView):
    """A controller of joints."""

    def stick_use(self) -> StickUse:
        """Return what the stick does now."""
        controller = self._robot.controller
        if controller.state is not State.POLICY:
            return StickUse((0.0, 0.0, 0.0), f'drives in {State.POLICY.value}')
        return StickUse(controller.full, 'drives the policy', backward=controller.backward)
