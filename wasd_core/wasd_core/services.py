# SPDX-License-Identifier: Apache-2.0
"""Services that do something and say what."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool, Trigger


def offer(node: Node, name: str, act: Callable[..., tuple[bool, str]], sets: bool = False) -> None:
    """Offer a Trigger, or a SetBool that gives `act` its data; `act` returns success and words."""

    def answer(request: Any, response: Any) -> Any:
        response.success, response.message = act(request.data) if sets else act()
        return response

    node.create_service(SetBool if sets else Trigger, name, answer)
