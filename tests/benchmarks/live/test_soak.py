"""A minute at 500 Hz with readers that come, go and stall: nothing is lost, nothing grows without bound."""

import contextlib
import json
import logging
import logging.config
import threading

import pytest
from click.testing import CliRunner
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

from contactsense.benchmarks.live import soak as readers
from contactsense.benchmarks.live.soak import soak
from tests.service.loopback import until


@pytest.mark.long
@pytest.mark.realtime
@pytest.mark.timeout(600)
def test_a_minute() -> None:
    outcome = CliRunner().invoke(soak, ["--minutes", "1", "--json"], standalone_mode=False)
    result = json.loads(outcome.stdout)
    assert result["lost_on_the_wire"] == 0
    assert result["restarts"] == 0
    assert result["visits"] > 5
    assert not result["events_missed"]
    assert result["memory"] < 2000.0


def test_readers_that_break_off_print_nothing(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stream(connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                connection.send("x" * 1000)

    monkeypatch.setattr(readers, "_VISIT", 0.05)
    logging.config.dictConfig({"version": 1, "disable_existing_loggers": False})  # as uvicorn does
    assert not readers._SILENT.isEnabledFor(logging.CRITICAL)
    silent = logging.getLogger("tests.silent")
    silent.disabled = True
    over, visits = threading.Event(), [0]
    with serve(stream, "127.0.0.1", 0, logger=silent) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        url = f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        work = threading.Thread(target=readers._come_and_go, args=(url, over, visits))
        work.start()
        assert until(lambda: visits[0] >= 20)
        over.set()
        work.join()
        server.shutdown()
    assert [record.getMessage() for record in caplog.records] == []
