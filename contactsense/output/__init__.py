"""From the numbers of the sample path to `Estimate`."""
