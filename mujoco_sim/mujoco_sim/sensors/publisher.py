# SPDX-License-Identifier: Apache-2.0
"""Publishes what sensors measure, for subscribers."""

import array
import io

from builtin_interfaces.msg import Time
import numpy as np
from rclpy.node import Node
import sensor_msgs.msg
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Header
from wasd_core.messages import to_cloud, to_stamp, to_transform
from wasd_core.streams import visible
from wasd_core.topics import has_listener, has_subscriber, RELIABLE, TfBroadcaster

from mujoco_sim.sensors.measuring import Sensors, SensorTopic
from mujoco_sim.sensors.mount import Fields

# Made only when somebody looks: a recording of everything would be 80 MB a second.
LARGE = ('Image', 'PointCloud2')
# How topics of colours end; those of depths have another.
COLOURS, DEPTHS = 'image_raw', 'depth/image_raw'
QUALITY = 85  # of JPEGs


def publish_sensors(node: Node, sensors: Sensors) -> None:
    """Publish from now on what sensors measure, and their frames; log what is not simulated."""
    for note in sensors.notes:
        node.get_logger().warning(visible(note))
    if sensors.frames:
        # Stamp 0: true at any time.
        TfBroadcaster(node, static=True).send(
            to_transform(pose, link, frame, Time()) for link, frame, pose in sensors.frames
        )
    for topic in sensors.topics:
        _publish_topic(node, topic)


def _publish_topic(node: Node, topic: SensorTopic) -> None:
    # The topic holds its listener, `publish`: so `publish` must not hold the topic.
    is_large, frame = topic.kind in LARGE, topic.frame
    topic_kind = topic.kind
    message_type = getattr(sensor_msgs.msg, topic.kind)
    publisher = node.create_publisher(message_type, topic.name, RELIABLE)

    def is_wanted() -> bool:
        return has_subscriber(node, publisher) if is_large else has_listener(publisher)

    def publish(now: float, fields: Fields) -> None:
        header = Header(stamp=to_stamp(now), frame_id=frame)
        if topic_kind == 'PointCloud2':
            publisher.publish(to_cloud(fields['points'][None], header))
        else:
            publisher.publish(message_type(header=header, **fields))

    topic.listen(publish, is_wanted)
    if topic.name.endswith(COLOURS) and not topic.name.endswith(DEPTHS):
        _publish_compressed(node, topic)


def _publish_compressed(node: Node, topic: SensorTopic) -> None:
    """Publish a camera's colours as JPEGs, by the name that image_transport gives them."""
    frame = topic.frame
    publisher = node.create_publisher(CompressedImage, f'{topic.name}/compressed', RELIABLE)

    def publish(now: float, fields: Fields) -> None:
        # Here, because few look through a camera.
        from PIL import Image

        shape = fields['height'], fields['width'], 3
        pixels = np.frombuffer(fields['data'], np.uint8).reshape(shape)
        written = io.BytesIO()
        Image.fromarray(pixels).save(written, 'JPEG', quality=QUALITY)
        message = CompressedImage(
            header=Header(stamp=to_stamp(now), frame_id=frame),
            format='rgb8; jpeg compressed bgr8',
            data=array.array('B', written.getvalue()),
        )
        publisher.publish(message)

    topic.listen(publish, lambda: has_subscriber(node, publisher))
