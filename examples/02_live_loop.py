"""A 500 Hz loop: samples from a robot and a force/torque sensor, estimates, a reaction.

Run it without arguments: it starts a simulated arm on this host and reads it over the real protocols. For a
real arm: python examples/02_live_loop.py ROBOT_ADDRESS SENSOR_ADDRESS

What to know before this drives anything:
* Budget. A sample comes every 2 ms; a step takes tens of microseconds. What else you do in the loop must fit
  into the rest. Readings that you fetch too late are not lost, they queue: `poll` returns several at once.
* Clock. `sample.t` is the robot's clock. Use it for everything that concerns motion; this host's clock only
  says how late you are. A gap in `sample.t` longer than a few samples starts the observers anew.
* Threads. A Localizer belongs to one thread. Another busy Python thread in the same process can delay this
  one by many milliseconds (the GIL), so give the loop a process of its own, as `contactsense serve` does.
* Degraded. An estimate with status "degraded" may lack a sensor, or the model does not fit. Do not read it
  as "no contact": slow down or stop, and log the reason.
* This is not a safety function.
"""

import sys
import time

from contactsense import Localizer, Scene
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.servers import MockServers, MockSettings
from contactsense.service.sensors.clients.robot_stream import SensorError
from contactsense.service.sensors.live_source import LiveSource
from contactsense.service.sensors.source_settings import SourceSettings

DURATION = 8.0  # [s]
BUDGET = 0.002  # time between two samples [s]


def loop(localizer: Localizer, source: LiveSource) -> None:
    """Step through samples for a while and print events."""
    late, steps, degraded, end = 0, 0, "", time.monotonic() + DURATION
    while time.monotonic() < end:
        for sample in source.poll(0.1):
            begin = time.perf_counter()
            estimate = localizer.step(sample)
            steps += 1
            late += time.perf_counter() - begin > BUDGET
            if estimate.status == "degraded" and estimate.reason != degraded:
                print(f"{sample.t:.3f} s  degraded: {estimate.reason}")  # a controller slows down here
            degraded = estimate.reason
            for event in estimate.events:
                best = estimate.contacts[0] if estimate.contacts else None
                print(f"{event.t:.3f} s  {event.kind}" + (f" on {best.link}" if best else ""))
    if steps == 0:
        sys.exit(f"no samples: {source.health.trouble}")
    print(f"{steps} samples; steps that took longer than {1e3 * BUDGET:g} ms: {late}")


def main() -> None:
    """Read the arm that was named, or a simulated one."""
    if len(sys.argv) not in (1, 3):
        sys.exit("expected ROBOT_ADDRESS SENSOR_ADDRESS, or nothing for a simulated arm")
    scene = Scene(robot="ur5e")
    localizer = Localizer(scene)  # compiles or loads the kernels: do that before the robot moves
    if len(sys.argv) == 3:
        settings = SourceSettings(robot_host=sys.argv[1], wrench_host=sys.argv[2])
        try:
            with LiveSource(scene, settings) as source:
                loop(localizer, source)
        except SensorError as error:  # an address that is none, or a sensor that contradicts the scene
            sys.exit(str(error))
        return
    with MockServers(simulate(Script.demo()), MockSettings(rtde_port=0, netft_port=0, http_port=0)) as mock:
        settings = SourceSettings(
            robot_host="127.0.0.1",
            robot_port=mock.rtde.port,
            wrench_host="127.0.0.1",
            wrench_port=mock.netft.port,
            wrench_http_port=mock.netft.http_port,
        )
        with LiveSource(scene, settings) as source:
            loop(localizer, source)


if __name__ == "__main__":
    main()
