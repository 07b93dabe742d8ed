"""The time of a sensor's latest error: when it was last the case, also after recovery."""

from dataclasses import replace

from contactsense.service.live.error_times import ErrorTimes
from contactsense.service.sensors.clients.netft_client import WrenchHealth
from contactsense.service.sensors.clients.robot_stream import StreamHealth


def test_it_is_that_of_the_last_moment_at_which_the_error_was_the_case() -> None:
    clock = iter(f"2026-01-01T00:00:{i:02d}.000+00:00" for i in range(60))
    times = ErrorTimes(lambda: next(clock))
    stream = StreamHealth("streaming")
    assert times.time_of("robot", stream) is None
    stream.state, stream.error, stream.failures = "waiting", "refused", 1
    first = times.time_of("robot", stream)
    still = times.time_of("robot", stream)
    assert first is not None
    assert still is not None
    assert first < still
    stream.state = "streaming"
    assert times.time_of("robot", stream) == still
    stream.failures = 2  # the same error again, over before anybody asked
    again = times.time_of("robot", stream)
    assert again is not None
    assert again > still
    assert times.time_of("robot", stream) == again


def test_each_sensor_has_its_own() -> None:
    clock = iter("abc")
    times = ErrorTimes(lambda: next(clock))
    one, other = StreamHealth("streaming", "x"), StreamHealth("streaming", "x")
    assert times.time_of("robot", one) == "a"
    assert times.time_of("base_wrench", other) == "b"
    assert times.time_of("robot", one) == "a"


def test_each_failure_of_a_force_torque_sensor_is_a_new_error() -> None:
    """It connected again, or reported an error itself, perhaps both once more since the last time."""
    clock = iter("abcd")
    times = ErrorTimes(lambda: next(clock))
    stream = WrenchHealth("streaming", "x", 0, 0, 0, 0, 0, 0, 0, 0, 0.0, None)
    found = [times.time_of("base_wrench", stream)]
    for reconnects, device_errors in ((1, 0), (1, 1), (2, 2)):
        stream = replace(stream, reconnects=reconnects, device_errors=device_errors)
        found.append(times.time_of("base_wrench", stream))
    assert found == ["a", "b", "c", "d"]
