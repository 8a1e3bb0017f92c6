"""`gaitchain serve` as a process of its own, on a free port of this computer."""

import os
import re
import select
import signal
import subprocess
import sys
from pathlib import Path

import httpx
from patience import PATIENCE_S, Deadline


class Service:
    """The real thing: supervisor, loop, API, viewer and log."""

    def __init__(self, *options, folder):
        self.log = folder / "walk.mcap"
        # It ends with the tests, also where these are killed.
        bound = ["setpriv", "--pdeathsig", "TERM", sys.executable]
        command = [*bound, "-m", "gaitchain", "serve", "--port", "0"]
        self.process = subprocess.Popen(
            [*command, "--log", str(self.log), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            cwd=folder,
            start_new_session=True,
        )
        self.said, self.client = "", None
        try:
            self.address = self.await_said(r"(http://\S+/)\S* \(Ctrl-C")
            self.client = httpx.Client(base_url=self.address, timeout=PATIENCE_S)
            assert self.client.get("/").status_code < 500  # told when it is there
            self.until(self.answers)
        except BaseException:
            self.kill_all()
            raise

    def await_said(self, pattern):
        """Wait for a line of its output; return what the pattern's group found.

        Whatever it says, such as that it compiles, gives it more time.
        """
        deadline = Deadline()
        while not (found := re.search(pattern, self.said)):
            if self.listen():
                deadline = Deadline()
            assert not deadline.passed(), f"it said only:\n{self.said}"
        return found.group(1)

    def listen(self):
        """Wait a moment for output; return whether there was any."""
        ready, _, _ = select.select([self.process.stdout], [], [], 1.0)
        if ready:
            said = os.read(self.process.stdout.fileno(), 65536).decode()
            assert said, f"it ended, and said:\n{self.said}"
            self.said += said
        return bool(ready)

    def until(self, happens):
        """Ask again and again until something is so; return what it gave."""
        deadline = Deadline()
        while not (found := happens()):
            if deadline.passed():
                raise AssertionError(f"{happens} never was: {self.said}\n{self.state}")
            select.select([], [], [], 0.05)
        return found

    def answers(self):
        try:
            return self.client.get("api/v1/state").status_code == 200
        except httpx.TransportError:
            return False

    @property
    def state(self):
        """The latest frame; None while nothing answers."""
        try:
            answer = self.client.get("api/v1/state")
        except httpx.TransportError:
            return None
        return answer.json() if answer.status_code == 200 else None

    def mode(self, name):
        """Whether the robot is in a mode; to be waited for."""
        state = self.state
        return state is not None and state["mode"] == name

    def reason(self, begins):
        """Whether the reason for the mode begins so; to be waited for."""
        state = self.state
        return state is not None and state["reason"].startswith(begins)

    def put(self, **command):
        try:
            return self.client.put("api/v1/command", json=command).status_code
        except httpx.TransportError:
            return None

    def drives(self, mode="walking", **command):
        """Repeat a command and say whether the mode has come."""
        self.put(**command)
        return self.mode(mode)

    def part(self, name):
        """Process id of a part; None if there is none."""
        try:
            children = Path(
                f"/proc/{self.process.pid}/task/{self.process.pid}/children"
            )
            for child in map(int, children.read_text().split()):
                words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
                if name.encode() in words[:5] and b"gaitchain.service.part" in words:
                    return child
        except (FileNotFoundError, ProcessLookupError):
            return None
        return None

    def parts(self):
        """Process ids of all parts by their names."""
        names = ("loop", "api", "viewer", "log", "ros")
        found = {name: self.part(name) for name in names}
        return {name: number for name, number in found.items() if number}

    def kill(self, name):
        """Kill a part the hard way; return its process id."""
        number = self.part(name)
        os.kill(number, signal.SIGKILL)
        return number

    def events(self, kind):
        answer = self.client.get("api/v1/events").json()
        return [event["text"] for event in _events(answer) if event["kind"] == kind]

    def end(self):
        """Ask it to end; return its exit code."""
        self.process.send_signal(signal.SIGTERM)
        said, _ = self.process.communicate(timeout=PATIENCE_S)
        self.said += said.decode()
        return self.process.returncode

    def kill_all(self):
        """Leave nobody behind, whatever happened."""
        if self.client is not None:
            self.client.close()
        numbers = list(self.parts().values())
        if self.process.poll() is None:
            self.process.kill()
            self.process.communicate()
        self.process.stdout.close()
        for number in numbers:
            try:
                os.kill(number, signal.SIGKILL)
            except ProcessLookupError:
                continue


def _events(answer):
    return answer["events"] if isinstance(answer, dict) else answer


def gone(number):
    """Whether a process has ended."""
    try:
        state = Path(f"/proc/{number}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"
