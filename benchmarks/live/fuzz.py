"""Fuzzing of all protocol parsers with corrupted bytes: each must return a value or raise its own error,
nothing else.

`python -m benchmarks.live.fuzz --inputs 1000000`; exit status 1 if a parser failed.
"""

import json
import random
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import click

from contactsense.benchmarks.live.fuzz_controllers import targets as controller_targets
from contactsense.benchmarks.live.fuzz_target import Target
from contactsense.service.wire import netft, rtde
from contactsense.service.wire.recipe import Recipe, RtdeProtocolError

_NAMES = ("timestamp", "actual_q", "actual_qd", "robot_mode")
_RECIPE = Recipe(1, _NAMES, ("DOUBLE", "VECTOR6D", "VECTOR6D", "INT32"))
_PACKET = _RECIPE.pack([1.0, *([0.5] * 12), 7])


def _frames(data: bytes) -> list[rtde.Frame]:
    decoder = rtde.FrameDecoder()
    found = []
    # In pieces, as bytes arrive.
    for start in range(0, len(data), 7):
        decoder.feed(data[start : start + 7])
        while (frame := decoder.next_frame()) is not None:
            found.append(frame)
    return found


def _replies(data: bytes) -> list[object]:
    return [rtde.parse_reply(frame) for frame in _frames(data)]


def _requests(data: bytes) -> list[object]:
    return [rtde.parse_request(frame) for frame in _frames(data)]


_REPLIES = (
    rtde.encode(rtde.ProtocolVersionReply(True)),
    rtde.encode(rtde.ControllerVersion(5, 23, 0, 0)),
    rtde.encode(rtde.SetupReply(False, 1, _RECIPE.types)),
    rtde.encode(rtde.StartReply(True)),
    rtde.encode(rtde.TextMessage("joint limit", "RTDE", 3)),
    _PACKET,
)
_REQUESTS = (
    rtde.encode(rtde.ProtocolVersionRequest()),
    rtde.encode(rtde.ControllerVersionRequest()),
    rtde.encode(rtde.OutputSetup(500.0, _NAMES)),
    rtde.encode(rtde.InputSetup(("input_int_register_24",))),
    rtde.encode(rtde.Start()),
    rtde.encode(rtde.Pause()),
)
TARGETS: list[Target] = [
    Target("RTDE replies", _replies, RtdeProtocolError, _REPLIES),
    Target("RTDE requests", _requests, RtdeProtocolError, _REQUESTS),
    Target("RTDE data", _RECIPE.unpack, RtdeProtocolError, (_PACKET[3:],)),
    Target(
        "Net F/T requests",
        netft.parse_request,
        netft.RdtProtocolError,
        (netft.Request(netft.Command.START_REALTIME, 0).encode(),),
    ),
]
"""Parsers of the sensors' protocols."""


def all_targets() -> list[Target]:
    """These, and the parsers of the controller interfaces."""
    return [*TARGETS, *controller_targets()]


@dataclass(slots=True)
class Result:
    """Result of one parser."""

    name: str
    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    defects: int = 0
    first_defect: str = ""
    """The input, in hexadecimal digits, and the error that it caused."""


def spoil(data: bytes, dice: random.Random) -> bytes:
    """Corrupt bytes: flip, remove, duplicate or insert some, or append noise."""
    spoiled = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 4, 8))):
        where = dice.randrange(len(spoiled) + 1)
        match dice.randrange(7):
            case 0 if spoiled:
                spoiled[where % len(spoiled)] ^= 1 << dice.randrange(8)
            case 1 if spoiled:
                spoiled[where % len(spoiled)] = dice.choice((0x00, 0x7F, 0x80, 0xFF, dice.randrange(256)))
            case 2:
                del spoiled[where:]
            case 3:
                del spoiled[where : where + dice.randrange(1, 9)]
            case 4:
                spoiled[where:where] = dice.randbytes(dice.randrange(1, 9))
            case 5:
                spoiled += spoiled[where : where + 40]
            case _:
                spoiled += dice.randbytes(dice.randrange(1, 40))
    return bytes(spoiled[:4096])


def fuzz(target: Target, inputs: int, seed: int = 1) -> Result:
    """Feed a parser with `inputs` corrupted inputs."""
    dice = random.Random(f"{seed} {target.name}")
    result = Result(target.name)
    for _ in range(inputs):
        data = spoil(dice.choice(target.seeds), dice)
        result.inputs += 1
        try:
            target.parse(data)
        except target.refuses:
            result.refused += 1
        except Exception as error:
            result.defects += 1
            result.first_defect = result.first_defect or f"{data.hex()}: {type(error).__name__}: {error}"
        else:
            result.accepted += 1
    return result


def run(inputs: int, seed: int, targets: Sequence[Target] | None = None) -> list[Result]:
    """Distribute the inputs among all parsers."""
    chosen = all_targets() if targets is None else targets
    share = -(-inputs // len(chosen))
    return [fuzz(target, share, seed) for target in chosen]


@click.command()
@click.option("--inputs", default=1_000_000, show_default=True, type=click.IntRange(1), help="In all.")
@click.option("--seed", default=1, show_default=True, help="Same seed, same inputs.")
@click.option("--json", "as_json", is_flag=True, help="Print the numbers as JSON.")
def main(inputs: int, seed: int, as_json: bool) -> None:
    """Feed corrupted bytes to all protocol parsers."""
    begin = time.monotonic()
    results = run(inputs, seed)
    if as_json:
        click.echo(json.dumps([asdict(result) for result in results]))
    else:
        for r in results:
            click.echo(
                f"{r.name:<24}{r.inputs:>9} inputs{r.accepted:>9} accepted{r.refused:>9} refused"
                f"{r.defects:>4} defects {r.first_defect}"
            )
        click.echo(f"{time.monotonic() - begin:.0f} s")
    sys.exit(int(any(result.defects for result in results)))


if __name__ == "__main__":
    main()
