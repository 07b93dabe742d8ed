"""When readings arrive over a simulated network, and at a busy host."""

import numpy as np

NS = 1e9
"""Nanoseconds in a second."""


def delays(rng, n):
    """A network's delays [s]: a shortest way, exponential jitter, and now and then several milliseconds."""
    return 3e-4 + rng.exponential(1e-4, n) + (rng.random(n) < 0.02) * rng.uniform(0.0, 8e-3, n)


def arrivals(rng, times):
    """Arrival of readings taken at these host times, in order [ns]."""
    return np.maximum.accumulate(((times + delays(rng, len(times))) * NS).astype(np.int64))


def held_up(rng, arrival, longest):
    """Arrivals at a reader that sleeps nine tenths of the time, for up to `longest` seconds at once [ns]."""
    arrival, begin = arrival.copy(), int(arrival[0] - longest * NS * rng.random())
    while begin < arrival[-1]:
        hold = rng.uniform(0.005, longest) * NS
        end = begin + int(hold)
        arrival[(arrival >= begin) & (arrival < end)] = end
        begin = end + int(rng.uniform(0.02, 0.2) * hold)
    return arrival
