"""Search where the line of action is known.

`line_of_action_search` starts on each primitive where the line enters it; if that explains nothing,
`multistart_search` starts from many places near the line.
"""
