"""The signals of a scene in the columns of a table, with the units and times that the estimator needs.

`signal_columns` finds them, as a `column_mapping` says. `cleaning`, `held_values` and `velocity_agreement`
check them; `sensor_delays` are taken off.
"""
