"""`contactsense demo`: a simulated arm, the service, and its estimates next to the ground truth."""

import time
from contextlib import ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.text import Text

from contactsense.robots.jit.compilation import CompilationProgress
from contactsense.robots.jit.progress_bar import CompilationBar
from contactsense.service.api.client import Client, ClientError
from contactsense.service.api.messages import HealthOut
from contactsense.service.cli.lazy import missing
from contactsense.service.demo.child_process import ChildError, child
from contactsense.service.demo.processes import Stage
from contactsense.service.demo.reaction_table import compare
from contactsense.service.demo.scoreboard import Scoreboard, Verdict
from contactsense.service.mock.arm.script import Script, ScriptError
from contactsense.service.mock.arm.simulated_arm import Motion, simulate
from contactsense.service.viewer import READY as VIEWER_READY

COLUMNS = {
    "at": 7,
    "touched": 11,
    "found": 11,
    "share": 7,
    "force": 7,
    "force error": 13,
    "point error": 13,
    "found after": 13,
}
"""Heading and width of the columns; `share`: fraction of the samples under full force with the true link."""
BLIND_SHARE = 0.3
"""With a larger share of samples that lack the base sensor's reading, the demo says so; some lack it until
the sensors' clocks are aligned."""


@click.command()
@click.option(
    "--script", type=click.Path(path_type=Path), help="What the arm does (YAML); default: the demo's."
)
@click.option("--serve", is_flag=True, help="Keep running until interrupted; the motion repeats.")
@click.option(
    "--view", is_flag=True, help="Show the arm and its contacts in a browser, until interrupted, as --serve."
)
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Port to serve at.  [default: a free one]"
)
@click.option(
    "--react", is_flag=True, help="Move into obstacles without and with a reaction, and compare the forces."
)
@click.option("--json", "as_json", is_flag=True, help="With --react: print the comparison as JSON.")
def demo(script: Path | None, serve: bool, view: bool, port: int, react: bool, as_json: bool) -> int:
    """Touch a simulated UR arm and print where the service finds each contact, next to the ground truth.

    Starts the service, and a mock robot with a force/torque sensor that speak the real protocols, each in a
    process of its own, and reads the service's WebSocket stream as any client would. Exit status 0 only if
    every link was found.
    """
    if react:
        if script is not None or serve or view:
            raise click.UsageError("--react: expected neither --script nor --serve nor --view beside it")
        return _react(port, as_json)
    if as_json:
        raise click.UsageError("--json: expected --react beside it")
    if view and find_spec("viser") is None:
        raise click.ClickException(missing("demo --view", "viser"))
    serve = serve or view
    try:
        played = Script.demo() if script is None else Script.load(script)
        if played.watchdog is not None:
            raise ScriptError(
                "watchdog: expected none, since nobody writes its variable in the demo, and the arm would "
                "not move as the script says: `contactsense mock --script` simulates it"
            )
        motion = simulate(played)
        _refuse_protective_stop(played, motion)
    except ScriptError as error:
        raise click.ClickException(str(error)) from None
    if serve and not motion.loops:
        option = "--view" if view else "--serve"
        raise click.ClickException(f"{option}: expected a script that ends where it begins")
    more = [] if script is None else ["--script", str(script)]
    more += ["--loop"] if serve else []
    console = Console(highlight=False, soft_wrap=True)
    try:
        with ExitStack() as stack:
            client = _start(console, stack, played, port, more, view)
            status = _compare(console, client, Scoreboard(motion), motion)
            if serve:
                _stay(console, client)
            return status
    except (ChildError, ClientError) as error:
        raise click.ClickException(str(error)) from None
    except KeyboardInterrupt:
        raise click.Abort from None


def _refuse_protective_stop(script: Script, motion: Motion) -> None:
    limit, delay = script.safety.force_limit, script.safety.force_delay
    if limit is None:
        return
    for touch in motion.touches:
        force = np.linalg.norm(touch.force_base, axis=1)
        if (force > limit).any() and (force > limit).sum() / motion.rate >= delay:
            raise ScriptError(
                f"safety.force_limit: expected contacts that do not exceed its {limit:g} N for {delay:g} s, "
                f"got one of {force.max():.3g} N at {touch.start:g} s, since the arm would stop and not move "
                "on as the script says: `contactsense mock --script` simulates it"
            )


def _react(port: int, as_json: bool) -> int:
    try:
        return compare(Console(highlight=False, soft_wrap=True), port, as_json)
    except (ChildError, ClientError) as error:
        raise click.ClickException(str(error)) from None
    except KeyboardInterrupt:
        raise click.Abort from None


def _start(
    console: Console, stack: ExitStack, script: Script, port: int, more: list[str], view: bool
) -> Client:
    noise = script.noise
    touches = "once" if len(script.contacts) == 1 else f"{len(script.contacts)} times"
    console.print(
        f"A simulated {script.robot} is touched {touches} in {script.duration:g} s.\n"
        f"Noise: {noise.base_force:g} N and {noise.base_moment:g} Nm at the base, "
        f"{noise.joint_torque:g} Nm at each joint."
    )
    began = time.monotonic()
    stage = stack.enter_context(Stage(script.robot, port))
    console.print("The service starts; the very first time it compiles its kernels, one or two minutes.")
    bar = _Loading(console)
    try:
        client = stage.start_service(
            on_url=(lambda url: _show(console, stack, url)) if view else (lambda url: None),
            on_health=bar.update,
        )
    finally:
        bar.close()
    console.print(f"The service is up after {time.monotonic() - began:.1f} s.")
    stage.start_arm(*more)
    return client


def _show(console: Console, stack: ExitStack, url: str) -> None:
    """Start the viewer, which shows what the service is doing until it has loaded."""
    page = stack.enter_context(child("view", "--url", url, "--port", "0")).wait_for(VIEWER_READY)
    console.print(Text(f"Open {page} in a browser.", style="bold"))


class _Loading:
    """Progress of the service's loading as a bar, or without a terminal, as one line per tenth."""

    def __init__(self, console: Console) -> None:
        self._bar = CompilationBar(console)

    def update(self, health: HealthOut) -> None:
        """Show the progress in this health."""
        if 0.0 < health.loading < 1.0 and health.loading_left is not None:
            self._bar.update(CompilationProgress(health.loading, health.loading_left))

    def close(self) -> None:
        """Remove the bar."""
        self._bar.close()


def _compare(console: Console, client: Client, board: Scoreboard, motion: Motion) -> int:
    console.print(Text(_row(list(COLUMNS)), style="bold"))
    verdicts: list[Verdict] = []
    lost = 0
    for message in client.stream():
        if isinstance(message, int):
            lost += message
            continue
        verdict = board.take(message)
        if verdict is not None:
            verdicts.append(verdict)
            console.print(Text(_line(verdict), style="" if verdict.right else "red"))
        if board.done:
            break
    console.print(
        "share: of the samples under full force, how many name the touched link first;\n"
        "force and point error: medians over these samples; found after: from the onset"
    )
    right = sum(verdict.right for verdict in verdicts)
    links = len({touch.link for touch in motion.touches})
    console.print(
        Text(
            f"{right} of {len(verdicts)} contacts on {links} links found on the right link; "
            f"{board.seen} estimates, {lost} lost, {board.false_alarms} false alarms.",
            style="bold green" if right == len(verdicts) else "bold red",
        )
    )
    if right < len(verdicts) and board.degraded:
        reason, _ = board.degraded.most_common(1)[0]
        console.print(f"{board.degraded.total()} estimates were degraded, most of them because: {reason}")
    source = client.health().source
    blind = source.without_wrench / max(source.robot.received, 1)
    if blind > BLIND_SHARE:
        console.print(
            f"{blind:.0%} of the samples lacked the force/torque reading: this computer was too busy to "
            "simulate the arm in time. Run the demo again when it is idle."
        )
    return 0 if right == len(verdicts) else 1


def _stay(console: Console, client: Client) -> None:
    client.close()  # nobody reads the stream from here on
    console.print(
        f"The simulation continues; Ctrl-C ends it.\n  latest estimate  {client.url}/v1/contacts\n"
        f"  stream           {client.stream_url}\n  interface        {client.url}/docs"
    )
    with suppress(KeyboardInterrupt):
        while True:
            time.sleep(3600.0)


def _line(verdict: Verdict) -> str:
    """Format one contact: time, ground truth, estimate, errors, delay."""
    touch = verdict.touch
    force = max((touch.force_base**2).sum(axis=1)) ** 0.5
    return _row(
        [
            f"{touch.start:.1f} s",
            touch.link,
            verdict.link or "nothing",
            f"{100.0 * verdict.share:.0f} %",
            f"{force:.0f} N",
            f"{verdict.force_error:.1f} N",
            f"{1e3 * verdict.error:.1f} mm",
            f"{1e3 * verdict.onset:.0f} ms",
        ]
    )


def _row(cells: list[str]) -> str:
    return "".join(cell.rjust(width) for cell, width in zip(cells, COLUMNS.values(), strict=True))
