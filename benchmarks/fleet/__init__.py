"""A year of a fleet by simulation: made, analysed, and compared with what was made."""
