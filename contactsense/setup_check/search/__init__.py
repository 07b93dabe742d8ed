"""The search for the wrong lines of a scene: which changes, alone or together, explain the readings.

`wrong_lines` accepts one `change` after the other among `candidate`s; an `explanation` is the set that
remains.
"""
