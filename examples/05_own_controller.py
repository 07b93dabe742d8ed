"""Contacts of an arm that the service does not read: its controller sends the samples over a WebSocket.

Run it without arguments: it starts a service on this host and sends the measurements of a simulated arm. For
a service that runs already: python examples/05_own_controller.py ws://ADDRESS:8000

What to change for a controller of your own:
* `SCENE`: your arm and its sensors, as in a scene file (docs/scene.md). Without that message the service's
  own scene applies. With `contactsense serve --source push` leave it out: the samples then feed the pipeline,
  which has the service's scene.
* `measurements`: what your controller reads, in SI units, at its own rate; `t` is its own clock.
* Nothing waits for an answer before the next sample is sent: answers come in the order of the samples.
* A controller that needs microseconds sends MessagePack instead of JSON (docs/controllers.md).
* This is not a safety function.
"""

import asyncio
import json
import sys
from collections.abc import AsyncIterator
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidURI, WebSocketException
from websockets.uri import parse_uri

from contactsense.service.api import READY
from contactsense.service.demo.child_process import child
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import Motion, simulate

SCENE = {
    "robot": "ur5e",
    "base_wrench": {"force_noise": 0.25, "moment_noise": 0.05},
    "joint_torque": {"noise": 1.0},
}
DURATION = 10.0  # of the simulated motion [s]


async def measurements(motion: Motion) -> AsyncIterator[dict[str, Any]]:
    """One sample after another, each at its time."""
    clock = asyncio.get_running_loop().time
    begin = clock()
    for i, t in enumerate(motion.t[motion.t < DURATION].tolist()):
        await asyncio.sleep(max(0.0, begin + t - clock()))
        yield {
            "t": t,
            "q": motion.q[i].tolist(),
            "qd": motion.qd[i].tolist(),
            "joint_torque": motion.joint_torque[i].tolist(),
            "base_wrench": motion.base_wrench[i].tolist(),
        }


async def send(connection: ClientConnection, motion: Motion) -> None:
    """Send all samples."""
    async for sample in measurements(motion):
        await connection.send(json.dumps(sample))


async def receive(connection: ClientConnection, samples: int) -> None:
    """Print what begins and ends until every sample is answered."""
    refused = ""
    for _ in range(samples):
        answer = json.loads(await connection.recv())
        if "errors" in answer:  # this sample cannot be used; the stream goes on
            error = "; ".join(f"{error['field']}: {error['reason']}" for error in answer["errors"])
            if error != refused:
                print(f"refused: {error}", file=sys.stderr)
            refused = error
            continue
        for event in answer["events"]:
            best = answer["contacts"][0] if answer["contacts"] else None
            place = f" on {best['link']}, probability {best['probability']:.2f}" if best else ""
            print(f"{event['t']:.3f} s  {event['kind']}{place}")


async def run(url: str) -> None:
    """Send the scene, then the samples, and print the answers."""
    motion = simulate(Script.demo())
    async with connect(f"{url}/v1/track", compression=None) as connection:
        await connection.send(json.dumps({"scene": SCENE}))
        answer = json.loads(await connection.recv())  # when the localizer is loaded
        if "errors" in answer:
            sys.exit(f"{answer['errors'][0]['field']}: {answer['errors'][0]['reason']}")
        print(f"links of the {answer['robot']}: {', '.join(answer['links'])}")
        await asyncio.gather(send(connection, motion), receive(connection, int((motion.t < DURATION).sum())))


def main() -> None:
    """Use the service that was named, or one that is started here."""
    if len(sys.argv) > 2:
        sys.exit("expected ws://ADDRESS:PORT, or nothing to start a service here")
    if len(sys.argv) == 2:
        url = sys.argv[1].rstrip("/")
        try:
            parse_uri(url)
        except (InvalidURI, ValueError):
            sys.exit(f"expected ws://ADDRESS:PORT, got {url}")
        try:
            asyncio.run(run(url))
        except OSError as error:
            sys.exit(f"{url}: no service answers ({error.strerror or error})")
        except WebSocketException as error:  # another program, no permission, or the service has ended
            sys.exit(f"{url}: {error}")
        return
    with child("serve", "--port", "0") as service:
        asyncio.run(run(service.wait_for(READY).replace("http", "ws", 1)))


if __name__ == "__main__":
    main()
