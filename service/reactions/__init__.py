"""Reactions: rules that turn estimates into actions on the robot. Not a safety function.

In the pipeline's process, `listener` gives each estimate to the `engine`, which evaluates the `rules` and
returns a `decision`. `register_output` and `lowered_slider` write to the robot at once, by `rtde_inputs`;
slow actions go through `executor_client` to the `executor`, a process of its own. `reports` tells the
service. There, `state` shows what was reported, `reaction_store` keeps latched collisions and a lowered speed
slider, and `webhook_delivery` sends webhooks. `actions` has one file for each kind of action.
"""
