"""Probabilities as people read them."""


def in_percent(probability: float) -> str:
    """A probability in whole percent; one that would be rounded to 100 is `> 99 %`."""
    return f"{100.0 * probability:.0f} %" if probability < 0.995 else "> 99 %"
