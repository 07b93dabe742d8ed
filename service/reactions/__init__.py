"""Reactions: rules that turn estimates into actions on the robot. Not a safety function.

In the pipeline's process, `listener` gives each estimate to the `engine`, which evaluates the `rules` and
returns a `decision`. `register_output` and `lowered_slider` write to the robot at once, by `rtde_inputs`;
slow actions go through `executor_client` to the `executor`, a process of its own. `reports` tells the
service. There, `state` shows what was reported, `reaction_store` keeps latched collisions and a lowered speed
slider, and `webhook_delivery` sends webhooks. `actions` has one file for each kind of action.

After a restart, the pipeline's new process learns what the one before has left:

    pipeline's process                                  service
    `listener` reports `started`  ------------------->  `state` knows latches and slider from earlier reports,
                                                        or from the file of `reaction_store`
    `engine` latches again, no action    <------------  command `restore` with both
    `register_output` may write (`latches_known`)
    `lowered_slider` raises the slider once
    nothing has touched the arm for a second
    `listener` reports `restored`  ------------------>  from now on `state` shows what is reported alone

Before that, `state` adds the latches that it knows to those that are reported. If no command comes, as there
is no service, the registers are written after a second.
"""
