"""The part that ROS talks to: what it subscribes to, over a real rosbridge."""

import threading

import pytest
from patience import PATIENCE_S
from ros_peers import RosbridgeServer

from gaitchain.cli.libraries import shipped_library
from gaitchain.service import ros_part
from gaitchain.service.settings import Settings, save_settings


@pytest.mark.parametrize(
    ("stamped", "kind"), [(False, "Twist"), (True, "TwistStamped")]
)
def test_commands_are_of_the_type_that_was_asked_for(stamped, kind, tmp_path):
    server, ended = RosbridgeServer(), threading.Event()
    library = str(shipped_library())
    save_settings(
        Settings(library=library, ros=server.url, ros_stamped=stamped), tmp_path
    )
    part = threading.Thread(target=ros_part.run, args=(tmp_path, ended))
    part.start()
    said = server.wait("subscribe", "/cmd_vel")
    ended.set()
    part.join(PATIENCE_S)
    server.close()
    assert said["type"] == f"geometry_msgs/msg/{kind}"
