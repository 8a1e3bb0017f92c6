"""The control loop of `gaitchain serve` beside clients that watch, one of them stalled.

    python benchmarks/live_loop.py [--clients 5] [--seconds 20] [--rate 250] [--page]

Starts the service as its users do, lets RES walk, and prints how well the loop kept its
rate: with nobody watching, then with clients on the telemetry socket of which one never
reads, then, with --page, with the page open in a headless Chromium as well. Last, how
long an emergency stop takes to reach the backend, in control periods.
"""

import argparse
import asyncio
import contextlib
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx
import numpy as np
import websockets
from websockets.asyncio.client import connect

_CHROMIUM = "/usr/bin/chromium"
_FLAGS = (
    "--headless --no-sandbox --disable-gpu --no-first-run --disable-sync "
    "--disable-background-networking --use-angle=swiftshader "
    "--enable-unsafe-swiftshader"
)


def main() -> None:
    """Measure, and print a row for each kind of company."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clients", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rate", type=float, default=250.0)
    parser.add_argument("--page", action="store_true")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, service(folder, asked.rate) as url:
        asyncio.run(measure(url, asked))


@contextlib.contextmanager
def service(folder: str, rate: float):
    """Run `gaitchain serve` on a free port; give its address."""
    command = [sys.executable, "-m", "gaitchain", "serve", "--port", "0"]
    process = subprocess.Popen(
        [*command, "--rate", str(rate), "--log", str(Path(folder) / "bench.mcap")],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield re.search(r"http://\S+/", process.stdout.readline()).group()
    finally:
        process.terminate()
        process.wait()


async def measure(url: str, asked: argparse.Namespace) -> None:
    """Walk in growing company."""
    async with httpx.AsyncClient(base_url=url, timeout=30.0) as client:
        while (await state(client)).get("mode") != "standing":
            await asyncio.sleep(0.2)
        driver = asyncio.create_task(keep_driving(client))
        await row("nobody", client, asked.seconds)
        address = url.replace("http", "ws") + "api/v1/stream?hz=50"
        async with contextlib.AsyncExitStack() as company:
            for number in range(asked.clients):
                socket = await company.enter_async_context(
                    connect(address, max_queue=1 if number == 0 else 16)
                )
                if number:  # the first one never reads
                    company.push_async_callback(
                        stop, asyncio.create_task(listen(socket))
                    )
            await row(f"{asked.clients} clients, 1 stalled", client, asked.seconds)
            if asked.page:
                with browser(url):
                    await row("and the page", client, asked.seconds)
        await stop(driver)
        print(f"emergency stop to torque off: {await stopping(client)}")


async def state(client: httpx.AsyncClient) -> dict:
    """Return the latest frame, empty while there is none."""
    with contextlib.suppress(httpx.TransportError):
        answer = await client.get("api/v1/state")
        return answer.json() if answer.status_code == httpx.codes.OK else {}
    return {}


async def keep_driving(client: httpx.AsyncClient) -> None:
    """Ask for a walk ahead, ten times a second."""
    while True:
        await client.put("api/v1/command", json={"vx": 0.3})
        await asyncio.sleep(0.1)


async def listen(socket: websockets.ClientConnection) -> None:
    """Read whatever comes."""
    async for _ in socket:
        pass


async def stop(task: asyncio.Task) -> None:
    """End a task."""
    task.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await task


async def row(company: str, client: httpx.AsyncClient, seconds: float) -> None:
    """Print how the loop does for some time."""
    first = await state(client)
    late = []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        late.append((await state(client))["pace"]["late_p99_s"])
        await asyncio.sleep(0.5)
    last = await state(client)
    before, after = first["pace"], last["pace"]
    ticks = after["ticks"] - before["ticks"]
    overruns = after["overruns"] - before["overruns"]
    print(
        f"{company:24s} {ticks / (last['time_s'] - first['time_s']):6.1f} Hz, p99 late "
        f"{1e3 * np.median(late):6.2f} ms, busy p99 {1e3 * after['busy_p99_s']:5.2f} "
        f"ms, {overruns} of {ticks} ticks overran",
        flush=True,
    )


@contextlib.contextmanager
def browser(url: str):
    """Have the page open in Chromium."""
    with tempfile.TemporaryDirectory() as profile:
        command = [_CHROMIUM, *_FLAGS.split(), f"--user-data-dir={profile}", url]
        process = subprocess.Popen([*command], stderr=subprocess.DEVNULL)
        try:
            yield
        finally:
            process.terminate()
            process.wait()


async def stopping(client: httpx.AsyncClient) -> str:
    """Stop at once; read off the events when it was asked and when it was done."""
    begin_ns = time.time_ns()
    await client.post("api/v1/emergency-stop")
    while (await state(client)).get("mode") != "stopped":
        await asyncio.sleep(0.005)
    events = (await client.get("api/v1/events")).json()["events"]
    done = next(e for e in reversed(events) if "emergency stop" in json.dumps(e))
    return f"{1e-6 * (done['stamp_ns'] - begin_ns):.1f} ms after the click"


if __name__ == "__main__":
    main()
