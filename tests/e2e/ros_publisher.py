"""A ROS node that publishes the contents of JSON lines, and answers each with a line once its topic has a subscriber and it is published.
Lines:
{"topic", "type": "MarkerArray" or "Marker", "message": fields}, {"topic", "type", "bytes": base64 of a message} or {"topic", "advertise":
type}, which
does not wait. The environment has ROS_MASTER_URI."""
import base64
import json
import sys
import threading
from typing import Any

import rospy
from genpy.message import fill_message_args
from std_msgs.msg import String
from visualization_msgs.msg import Marker, MarkerArray

LONG = 60.0


class Listener(rospy.SubscribeListener):  # type: ignore[misc]
    def __init__(self) -> None:
        super().__init__()
        self.subscribed = threading.Event()

    def peer_subscribe(self, *_: object) -> None:
        self.subscribed.set()


def raw(kind: Any) -> Any:
    """Returns messages with exactly the given bytes."""

    class Raw(kind):  # type: ignore[misc]
        def __init__(self, data: bytes) -> None:
            super().__init__()
            self.data = data

        def serialize(self, buff: Any) -> None:
            buff.write(self.data)

        __slots__ = ["data"]

    return Raw


def main() -> None:
    rospy.init_node("robot", anonymous=True, disable_rosout=True, disable_signals=True)
    publishers: dict[str, Any] = {}
    for line in sys.stdin:
        said = json.loads(line)
        kind = {"MarkerArray": MarkerArray, "Marker": Marker, "String": String}[said.get("type") or said["advertise"]]
        topic = said["topic"]
        if topic not in publishers:
            listener = Listener()
            publishers[topic] = rospy.Publisher(topic, kind, listener, queue_size=1000), listener
        publisher, listener = publishers[topic]
        if "advertise" not in said:
            if not listener.subscribed.wait(LONG):
                sys.exit(f"nobody subscribes to {topic}")
            if "bytes" in said:
                publisher.publish(raw(kind)(base64.b64decode(said["bytes"])))
            else:
                message = kind()
                fill_message_args(message, [said["message"]])
                publisher.publish(message)
        print(json.dumps({"done": topic}), flush=True)


main()
