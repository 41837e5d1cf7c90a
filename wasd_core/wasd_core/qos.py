# SPDX-License-Identifier: Apache-2.0
"""
The qualities of service of every topic: publishers offer the most, subscribers ask for the least.

So every ROS tool gets every topic whatever it asks for, and a sensor's consumer never waits for
a lost message. That is REP 2003 for sensors (source: system default, which is reliable; consumer:
sensor data, best effort) and the habit of robot_state_publisher, tf2 and rclcpp for the others.
"""

from rclpy.qos import DurabilityPolicy
from rclpy.qos import qos_profile_sensor_data
from rclpy.qos import QoSProfile

# Publishers of sensors, states, odometry, /clock; both ends of commands. Reliable, 10 deep.
RELIABLE = QoSProfile(depth=10)

# Keys: a burst, a paste or a script from a pipe, must not lose one.
EVENTS_DEPTH = 10_000
EVENTS = QoSProfile(depth=EVENTS_DEPTH)

# Subscribers to sensors, states, streamed joint commands: best effort, 5 deep (REP 2003).
SENSOR_DATA = qos_profile_sensor_data

# Subscribers that show the newest and nothing else.
LATEST = QoSProfile(depth=1, reliability=qos_profile_sensor_data.reliability)

# robot_description, state, selected: who comes late gets the last one. As robot_state_publisher.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)

# As tf2: /tf has many senders and must not lose one; /tf_static is kept for who comes late.
TF = QoSProfile(depth=100)
TF_STATIC = LATCHED
