"""Paths of ROS: their poses are walked as places, one after another."""

import math
import threading
from collections.abc import Callable, Iterator

from gaitchain.backends.ros import RosLink
from gaitchain.backends.ros import messages as ros
from gaitchain.errors import CommandError
from gaitchain.live.messages import Drive, GoTo, LetGo, Note, Request, Telemetry
from gaitchain.live.trip import check_count
from gaitchain.walker.place import Place, check_place

TOPIC = "/gaitchain/path"
_ODOM, _BASE = ("", "odom"), ("base_link", "base_footprint")
_APART_M = 0.05  # poses nearer to the one before are left out, but for the last one
_OFF_UNIT = 0.01  # of the length of a quaternion: numbers of few digits
_AGAIN_S = 1.0  # the driver is heard at least so often
_UNHEARD_S = 2.0  # an errand that the loop has not begun by then was refused


class RosPath:
    """Walks the latest path of a link, and keeps the wheel meanwhile."""

    def __init__(
        self, link: RosLink, ask: Callable[[Request], bool], driver: str
    ) -> None:
        """Subscribe.

        Args:
            link: to the ROS network.
            ask: passes a request on; False if the loop takes none.
            driver: who asks.

        Raises:
            CommandError: the link takes no such topic.
        """
        self._ask, self._driver = ask, driver
        self._lock = threading.Lock()  # paths come on a thread of the link
        self._errand: GoTo | None = None
        self._began_s = self._asked_s = -math.inf
        self._goes = False
        self._latest: Telemetry | None = None
        link.subscribe(TOPIC, ros.Path, self._walk)

    @property
    def is_walked(self) -> bool:
        """Whether a path is asked for."""
        return self._errand is not None

    def forget(self) -> None:
        """Ask for it no more: a command has taken its place."""
        with self._lock:
            self._errand = None

    def take(self, telemetry: Telemetry) -> None:
        """Take the newest telemetry: ask again, or let go at the end of the path."""
        with self._lock:
            before, self._latest = self._latest, telemetry
            errand, now_s = self._errand, telemetry.time_s
            if errand is None:
                return
            if before is not None and now_s < before.time_s:
                self._errand = None  # its numbers are of places that are no more
                self._refuse("the loop began anew before it was walked; send it again")
            elif self._is_over(errand, telemetry):
                self._errand = None
                if telemetry.driver == self._driver:
                    self._ask(LetGo(self._driver))
            elif not 0.0 <= now_s - self._asked_s < _AGAIN_S:
                self._asked_s = now_s
                self._ask(errand)

    def _is_over(self, errand: GoTo, telemetry: Telemetry) -> bool:
        """Whether it arrived, was stopped, or never began.

        The loop may still tell of the path before, or of what somebody else asked for:
        so it has arrived only where it was on its way.
        """
        if self._asked_s == -math.inf:
            return False
        going = telemetry.going
        on_its_way = (
            going is not None
            and going.goal == errand.places[-1]
            and not going.arrived
            and telemetry.driver == self._driver
        )
        ended = self._goes and not on_its_way
        self._goes = self._goes or on_its_way
        unheard = not self._goes and telemetry.time_s - self._began_s > _UNHEARD_S
        return ended or unheard

    def _walk(self, path: ros.Path) -> None:
        with self._lock:
            latest = self._latest
            if latest is None or latest.place is None:
                self._refuse("nothing measures where this robot is")
            elif not path.poses:
                self._errand = None
                self._ask(Drive(self._driver))  # after a stop, leave to be sent anew
                self._ask(LetGo(self._driver))
            else:
                self._begin(path, latest, latest.place)

    def _begin(self, path: ros.Path, latest: Telemetry, here: Place) -> None:
        try:
            places = tuple(_thinned(_places(path, here)))
            check_count(len(places))
        except CommandError as error:
            self._refuse(str(error))
            return
        self._goes, self._began_s = False, latest.time_s
        self._asked_s = -math.inf
        self._errand = GoTo(self._driver, places)

    def _refuse(self, why: str) -> None:
        self._ask(Note("command", f"path on {TOPIC} refused: {why}"))


def _places(path: ros.Path, here: Place) -> Iterator[Place]:
    """Yield the poses as places.

    Raises:
        CommandError: a pose is in another frame, turned by no rotation, or further than
            any robot is sent.
    """
    for number, stamped in enumerate(path.poses, start=1):
        frame = stamped.header.frame_id or path.header.frame_id
        name = f"pose {number}"
        place = _place(stamped.pose, name)
        if frame in _BASE:
            moved = here.moved(place.x, place.y)
            place = moved._replace(yaw=here.yaw + place.yaw)
        elif frame not in _ODOM:
            raise CommandError(f"{name} is in {frame}; odom and base_link do")
        check_place(place, name)
        yield place


def _place(pose: ros.Pose, name: str) -> Place:
    q, at = pose.orientation, pose.position
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(length - 1.0) <= _OFF_UNIT:  # NaN is refused, too
        raise CommandError(
            f"{name} has an orientation of length {length:g}, no rotation; its length "
            "is 1, as z = sin(yaw / 2) and w = cos(yaw / 2) have"
        )
    across = q.y * q.y + q.z * q.z
    yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * across)
    return Place(at.x, at.y, yaw)


def _thinned(places: Iterator[Place]) -> Iterator[Place]:
    """Leave out places that are hardly apart; the last one stays."""
    kept = place = None
    for place in places:
        if kept is None or math.hypot(place.x - kept.x, place.y - kept.y) > _APART_M:
            kept = place
            yield place
    if place is not None and place is not kept:
        yield place
