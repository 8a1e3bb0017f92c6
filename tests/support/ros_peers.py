"""Real peers for the tests of ROS 2: a Zenoh router, a small rosbridge server."""

import json
import queue
import socket
import threading
from contextlib import contextmanager

import zenoh
from patience import PATIENCE_S, Deadline
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def zenoh_session(mode, *, connect=(), listen=()):
    config = zenoh.Config()
    for key, value in {
        "mode": mode,
        "connect/endpoints": list(connect),
        "listen/endpoints": list(listen),
        "scouting/multicast/enabled": False,
        "scouting/delay": 0,
    }.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


@contextmanager
def zenoh_router(port):
    """What `rmw_zenohd` is: a router that nodes meet at."""
    router = zenoh_session("router", listen=[f"tcp/127.0.0.1:{port}"])
    try:
        yield router
    finally:
        router.close()


class RosbridgeServer:
    """Enough of a rosbridge_server: topics of one type, JSON, messages passed on."""

    def __init__(self, port=0):
        self.heard = queue.Queue()
        """What clients said, as it came."""
        self.wanted, self.types = {}, {}
        self.connections = []
        self._lock = threading.Lock()
        self._server = serve(
            self._handle, "127.0.0.1", port, compression=None, close_timeout=0.5
        )
        self.port = self._server.socket.getsockname()[1]
        self.url = f"ws://127.0.0.1:{self.port}"
        self._thread = threading.Thread(target=self._server.serve_forever)
        self._thread.start()

    def _handle(self, connection):
        with self._lock:
            self.connections.append(connection)
        try:
            for text in connection:
                said = json.loads(text)
                self._act(connection, said)
                self.heard.put(said)
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                for clients in self.wanted.values():
                    clients.discard(connection)

    def _act(self, connection, said):
        topic = said.get("topic")  # none of a service
        if said["op"] in ("advertise", "subscribe"):
            kind = self.types.setdefault(topic, said["type"])
            if kind != said["type"]:
                say(connection, op="status", level="error", msg=f"{topic} is {kind}")
                return
        if said["op"] == "subscribe":
            with self._lock:
                self.wanted.setdefault(topic, set()).add(connection)
        elif said["op"] == "publish":
            self.tell(topic, said["msg"])

    def tell(self, topic, message):
        """Pass a message on to who wants it."""
        with self._lock:
            clients = tuple(self.wanted.get(topic, ()))
        for client in clients:
            say(client, op="publish", topic=topic, msg=message)

    def wait(self, op, topic):
        """Return what was said about the topic; what came before is forgotten."""
        while True:
            said = self.heard.get(timeout=PATIENCE_S)
            if said["op"] == op and said.get("topic") == topic:
                return said

    def close(self):
        self._server.shutdown()
        for connection in tuple(self.connections):
            connection.close()
        self._thread.join(PATIENCE_S)


def say(connection, **fields):
    connection.send(json.dumps(fields))


def until(true):
    """Wait for something that another thread brings about."""
    pause, deadline = threading.Event(), Deadline()
    while not true():
        assert not deadline.passed(), "not in time"
        pause.wait(0.01)
