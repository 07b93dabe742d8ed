"""Settings of each sensor, the conversion of samples, and which of their values can be used."""
