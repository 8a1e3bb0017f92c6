"""What the page of the API says to send is taken."""

import json
import re
import shlex
from itertools import pairwise
from pathlib import Path

import pytest
from api_server import served

from gaitchain.walker.place import ORIGIN

PAGE = Path(__file__).parents[2] / "docs" / "api.md"
HERE = "localhost:8700"


def requests():
    """Return method, path, headers and body of each command with curl."""
    text = PAGE.read_text("utf-8").replace("\\\n", " ")
    return [read(line) for line in re.findall(r"\bcurl [^\n;]*", text)]


def read(line):
    words = shlex.split(line, comments=True)
    options = dict(pairwise(words))
    (address,) = (word for word in words if word.startswith(HERE))
    headers = [options["-H"].split(": ")] if "-H" in options else []
    return options["-X"], address.removeprefix(HERE), headers, options.get("-d")


def test_the_page_has_commands_for_what_matters():
    paths = {path.removeprefix("/api/v1/") for _, path, *_ in requests()}
    assert paths == {"start", "command", "emergency-stop", "disturbances", "goal"}


@pytest.mark.parametrize("request_", requests(), ids=lambda r: r[1])
def test_a_command_of_the_page_is_passed_on(request_):
    method, path, headers, body = request_
    with served() as here:
        here.loop.changes = {"place": ORIGIN}  # as of a robot that walks strides
        here.until(lambda: here.client.get("api/v1/state").json()["place"] is not None)
        answer = here.client.request(method, path, headers=headers, content=body)
        said = answer.json()
    assert answer.status_code == 202, said
    if body is not None:
        assert json.loads(body)
