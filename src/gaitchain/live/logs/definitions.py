"""Definitions of the messages in a log, as every ROS 2 has them; one is our own.

They travel in the file, so that a reader needs no ROS. In the order of the fields,
which is the order of the bytes.
"""

_PARTS = {
    "builtin_interfaces/Time": """
int32 sec
uint32 nanosec""",
    "std_msgs/Header": """
builtin_interfaces/Time stamp
string frame_id""",
    "geometry_msgs/Vector3": """
float64 x
float64 y
float64 z""",
    "geometry_msgs/Point": """
float64 x
float64 y
float64 z""",
    "geometry_msgs/Quaternion": """
float64 x
float64 y
float64 z
float64 w""",
    "geometry_msgs/Twist": """
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular""",
    "geometry_msgs/Transform": """
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation""",
    "geometry_msgs/TransformStamped": """
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform""",
}
_MESSAGES = {
    "sensor_msgs/msg/JointState": """
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort""",
    "sensor_msgs/msg/Imu": """
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance""",
    "geometry_msgs/msg/TwistStamped": """
std_msgs/Header header
geometry_msgs/Twist twist""",
    "geometry_msgs/msg/PointStamped": """
std_msgs/Header header
geometry_msgs/Point point""",
    "tf2_msgs/msg/TFMessage": """
geometry_msgs/TransformStamped[] transforms""",
    "rcl_interfaces/msg/Log": """
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line""",
    "gaitchain_msgs/msg/Decision": """
std_msgs/Header header
string key_moment
uint8 layer
int32 pose
int32 target
float64 cost
bool left_support
int32[] runner_up
float64[] runner_up_cost
string[] primitive
float64[] value""",
}
TYPES = tuple(_MESSAGES)
"""Names of all messages."""
_RULE = "=" * 80


def definition(name: str) -> str:
    """Return a message's definition with those of its parts, as MCAP wants it."""
    texts, todo, done = [_MESSAGES[name].strip()], [_MESSAGES[name]], set[str]()
    while todo:
        for line in todo.pop(0).split("\n"):
            part = line.partition(" ")[0].removesuffix("[]")
            if part in _PARTS and part not in done:
                done.add(part)
                todo.append(_PARTS[part])
                texts.append(f"{_RULE}\nMSG: {part}{_PARTS[part]}")
    return "\n".join(texts) + "\n"
