"""The simulated controller: it obeys commands and steps the arm by `contactsense.service.mock.physics`.

`robot_controller` makes the steps, after the `motion_generator`, and executes programs (`program_runner`);
`robot_state` is its state at one instant, `pushes` are scripted touches, `contact_log` tells of collisions.
"""
