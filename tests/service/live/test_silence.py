"""Silence counts only where the process and the service had the chance to talk."""

import os
import signal
import subprocess
import sys

import pytest

from contactsense.service.live.silence import ProcessState, Silence, process_state
from tests.service.loopback import until


def silence_after(ticks, letter, cpu_share=0.0):
    """Seconds of silence, and of being stopped, after ticks at these times."""
    silence = Silence(0.0)
    for t in ticks:
        silence.tick(t, ProcessState(letter, 100.0 * cpu_share * t))
    return silence.seconds, silence.stopped


TICKS = [0.1 * k for k in range(1, 21)]


def test_a_sleeping_process_is_silent():
    assert silence_after(TICKS, "S") == (pytest.approx(2.0), 0.0)


def test_a_process_in_an_endless_loop_is_silent():
    assert silence_after(TICKS, "R", 0.9) == (pytest.approx(2.0), 0.0)


@pytest.mark.parametrize(("share", "counts"), [(0.05, 0.0), (0.19, 0.0), (0.21, 2.0)])
def test_a_process_that_gets_less_than_a_fifth_of_a_processor_is_not_to_blame(share, counts):
    assert silence_after(TICKS, "R", share)[0] == pytest.approx(counts)


def test_processor_time_is_counted_in_the_clock_ticks_of_the_system():
    silence = Silence(0.0, clock_ticks=1000.0)
    for t in TICKS:
        silence.tick(t, ProcessState("R", 1000.0 * 0.1 * t))
    assert silence.seconds == 0.0


def test_a_stopped_process_and_a_zombie_are_known_as_such():
    assert silence_after(TICKS, "T")[1] == pytest.approx(2.0)
    assert silence_after(TICKS, "Z")[1] == pytest.approx(2.0)


def test_a_process_that_is_stopped_now_and_then_has_not_been_stopped_for_long():
    silence = Silence(0.0)
    for k, t in enumerate(TICKS):
        silence.tick(t, ProcessState("TS"[k % 2], 0.0))
    assert silence.stopped == 0.0
    silence.tick(TICKS[-1] + 0.1, ProcessState("T", 0.0))
    assert silence.stopped == pytest.approx(0.1)


def test_our_own_lateness_does_not_count():
    assert silence_after([10.0, 20.0, 30.0], "S")[0] == pytest.approx(0.6)


def test_a_word_ends_the_silence():
    silence = Silence(0.0)
    silence.tick(1.0, ProcessState("T", 0.0))
    silence.reset()
    assert (silence.seconds, silence.stopped) == (0.0, 0.0)


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux' /proc")
def test_the_state_of_a_real_process():
    process = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    try:
        assert until(lambda: process_state(process.pid).letter == "S")
        os.kill(process.pid, signal.SIGSTOP)
        assert until(lambda: process_state(process.pid).letter == "T")
        process.kill()
        assert until(lambda: process_state(process.pid).letter == "Z")
    finally:
        process.kill()
        process.wait()
    assert process_state(process.pid).letter == ""


@pytest.mark.skipif(sys.platform != "linux", reason="needs Linux' /proc")
def test_the_processor_time_of_a_real_process():
    """That of the program and that of the system for it."""
    before = os.times()
    found = process_state(os.getpid()).cpu / os.sysconf("SC_CLK_TCK")
    after = os.times()
    rounding = 2.0 / os.sysconf("SC_CLK_TCK")
    assert before.user + before.system - rounding <= found <= after.user + after.system + rounding
