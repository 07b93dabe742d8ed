"""The simulated controller: it obeys commands and steps the arm by `contactsense.service.mock.physics`.

`robot_controller` makes the steps, after the `motion_generator`; `robot_state` is its state at one instant,
`pushes` are scripted touches, and `contact_log` tells of collisions.
"""
