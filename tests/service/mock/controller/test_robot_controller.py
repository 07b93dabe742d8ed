"""The controller that lives: programs, speed slider, stops, watchdog, protective stops."""

import numpy as np
import pytest

from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.measured_velocity import REST
from contactsense.service.mock.arm.script import Script, ScriptError
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.mock.controller.program_runner import Command
from contactsense.service.mock.controller.robot_controller import UNLOCK_AFTER, RobotController
from contactsense.service.mock.controller.robot_state import RuntimeState
from contactsense.service.mock.urscript.parser import parse

FIELDS = {
    "robot": "ur5e",
    "trajectory": {
        "start": [0.0, -1.3, 1.6, -1.9, -1.57, 0.0],
        "dwell": 0.2,
        "moves": [{"to": [1.2, -1.3, 1.6, -1.9, -1.57, 0.0], "duration": 2.0, "dwell": 0.2}],
    },
}


def robot(loop=False, **fields):
    script = Script.model_validate(FIELDS | fields)
    return RobotController(Cell.of_script(script), script, loop=loop)


def test_it_plays_the_script_as_the_recorded_simulation_does():
    contact = {
        "link": "forearm",
        "point": [-0.1747, 0.0373, 0.0095],
        "normal": [-0.0008, 0.9931, 0.1174],
        "push": 25.0,
        "start": 0.5,
        "duration": 1.0,
    }
    live = robot(contacts=[contact])
    recorded = simulate(live.script)
    for k in range(0, 1150, 25):
        reading = live.at(k / 500.0)
        # The servos yield a little under the push.
        np.testing.assert_allclose(reading.q, recorded.q[k], atol=1.5e-3)
        np.testing.assert_allclose(reading.torque, recorded.joint_torque[k], atol=0.35)
        np.testing.assert_allclose(reading.base, recorded.base_wrench[k], atol=0.6)
    assert live.at(2.5).runtime is RuntimeState.STOPPED


def test_the_state_of_a_time_is_the_same_whoever_asks_when():
    first, second = robot(noise={"base_force": 0.2, "seed": 5}), robot(noise={"base_force": 0.2, "seed": 5})
    asked = [first.at(t).base for t in (0.5, 0.7, 0.6)]
    second.advance_to(0.9)
    np.testing.assert_array_equal(asked, [second.at(t).base for t in (0.5, 0.7, 0.6)])


def test_velocities_of_joints_that_move_have_noise():
    exact, noisy = robot(), robot(noise={"joint_velocity": 0.001, "seed": 4})
    moving, resting = [], []
    for k in range(150, 1000):
        error = noisy.at(k / 500.0).qd - exact.at(k / 500.0).qd
        moving.append(error[0])
        resting.append(error[1:])
    assert np.std(moving) == pytest.approx(0.001, rel=0.1)
    assert np.abs(resting).max() < REST
    assert noisy.at(2.6).qd == pytest.approx(exact.at(2.6).qd)


def test_a_joint_at_rest_reports_no_velocity():
    """An estimator would take a settling servo for a joint that moves without noise."""
    live = robot(noise={"joint_velocity": 0.001, "seed": 4})
    assert live.at(1.5).qd[0] != 0.0
    assert not live.at(2.6).qd.any()


@pytest.mark.slow
def test_the_speed_slider():
    live = robot()
    live.advance_to(1.0)
    live.receive({"speed_slider_mask": (1,), "speed_slider_fraction": (0.3,)})
    slow = live.at(2.0)
    assert slow.slider == 0.3
    assert slow.speed == pytest.approx(0.3)
    assert slow.runtime is RuntimeState.PLAYING
    assert live.at(2.4).q[0] < 1.0
    live.advance_to(8.0)
    assert live.at(8.0).q[0] == pytest.approx(1.2, abs=1e-6)


def test_pause_and_play():
    live = robot()
    live.advance_to(1.0)
    assert live.pause()
    assert live.at(1.05).runtime is RuntimeState.PAUSING
    at_rest = live.at(2.0)
    assert at_rest.runtime is RuntimeState.PAUSED
    np.testing.assert_allclose(at_rest.qd, 0.0, atol=1e-6)
    assert not live.pause()
    assert live.play()
    assert live.at(5.0).q[0] == pytest.approx(1.2, abs=1e-6)
    assert live.at(5.0).runtime is RuntimeState.STOPPED


def test_play_is_refused_until_the_arm_has_stopped():
    live = robot()
    live.advance_to(1.0)
    live.stop()
    live.advance_to(1.01)
    assert not live.play()
    assert live.at(2.0).runtime is RuntimeState.STOPPED
    assert live.play()
    assert live.at(7.0).q[0] == pytest.approx(1.2, abs=1e-6)


def test_a_program_in_a_dwell_ends_the_motion_of_the_script():
    live = robot()
    live.advance_to(0.1)
    live.run(parse("def f():\n  sleep(10)\nend"))
    assert live.at(1.5).runtime is RuntimeState.PLAYING
    np.testing.assert_allclose(live.at(1.5).target[0], FIELDS["trajectory"]["start"])


@pytest.mark.slow
def test_a_stop_program_replaces_the_running_one():
    live = robot()
    live.advance_to(1.2)
    before = live.at(1.2)
    speed = before.target[1, 0]
    live.run(parse("def contact_stop():\n  stopj(4.0)\nend"))
    after = live.at(2.2)
    assert after.target[0, 0] - before.target[0, 0] == pytest.approx(speed**2 / 8.0, rel=0.01)
    assert after.runtime is RuntimeState.STOPPED
    assert live.play()
    # It starts over: back to the beginning, then along.
    assert live.at(12.0).q[0] == pytest.approx(1.2, abs=1e-6)


def test_programs_move_write_registers_and_tell_what_is_not_simulated():
    live = robot()
    said = []
    live.on_message.append(said.append)
    live.run(
        parse(
            "def f():\n  movej([0.5, -1.3, 1.6, -1.9, -1.57, 0.0], a=2.0, v=1.0)\n"
            "  write_output_integer_register(3, 7)\n  freedrive_mode()\n  textmsg('there ', 1)\nend"
        )
    )
    live.advance_to(4.0)
    assert live.at(4.0).q[0] == pytest.approx(0.5, abs=1e-6)
    assert live.outputs["output_int_register_3"] == (7,)
    assert said == ["program f: the mock does not simulate `freedrive_mode()`", "there 1"]
    live.run(parse("sec g():\n  popup('look')\nend"))
    assert live.popup == "look"


def test_a_program_with_wrong_arguments_is_not_run():
    live = robot()
    live.advance_to(1.0)
    live.run(parse("def f():\n  stopj(0)\n  popup('look')\nend"))
    live.run(parse("sec g():\n  popup('look')\n  write_output_integer_register(1)\nend"))
    assert list(live.log) == [
        "program f: not run: stopj: a: expected a number above 0, got 0",
        "program g: not run: write_output_integer_register: expected value, got nothing",
    ]
    # The motion of the script goes on.
    assert live.at(3.0).q[0] == pytest.approx(1.2, abs=1e-6)
    assert live.popup == ""


def test_commands_of_ur_rtde_with_wrong_numbers_are_not_executed():
    live = robot()
    live.advance_to(2.5)
    live.run(parse("def rtde_control():\n  reg_offset_int = 0\nend"))
    live.advance_to(2.6)
    for command in (Command.MOVEJ, Command.STOPJ):
        live.receive({"input_int_register_0": (int(command),), "input_double_register_1": (float("nan"),)})
        live.advance_to(live.now + 0.1)
        assert live.outputs["output_int_register_0"] == (2,)
        live.receive({"input_int_register_0": (0,)})
        live.advance_to(live.now + 0.1)
    assert list(live.log) == [
        "ur_rtde: command 1 not executed: expected a number, got nan",
        "ur_rtde: command 34 not executed: expected a number above 0, got 0.0",
    ]
    live.receive({"speed_slider_mask": (1,), "speed_slider_fraction": (float("nan"),)})
    assert live.slider == 1.0


@pytest.mark.parametrize(
    ("action", "state"), [("pause", RuntimeState.PAUSED), ("stop", RuntimeState.STOPPED)]
)
def test_a_watchdog_that_is_not_fed(action, state):
    live = robot(watchdog={"variable": "input_int_register_47", "min_frequency": 10.0, "action": action})
    for k in range(80):  # fed every 10 ms
        live.advance_to(k * 0.01)
        live.receive({"input_int_register_47": (k,)})
    assert live.at(0.85).runtime is RuntimeState.PLAYING
    assert live.at(2.0).runtime is state
    assert "watchdog: input_int_register_47" in live.log[-1]


WALL = {"kind": "sphere", "name": "post", "center": [-0.35, -0.62, 0.5], "radius": 0.1, "stiffness": 15000.0}


@pytest.mark.slow
def test_an_obstacle_in_the_way_stops_the_arm_by_the_controllers_own_safety():
    free = robot(obstacles=[WALL], safety={"position_deviation": 1.0})
    free.advance_to(2.4)
    (record, *_) = free.contacts.records
    assert record.obstacle == "post"
    assert record.peak_force > 60.0
    guarded = robot(obstacles=[WALL], safety={"force_limit": 50.0, "force_delay": 0.0})
    guarded.advance_to(2.4)
    assert guarded.protective
    assert guarded.at(2.4).runtime is RuntimeState.PAUSED
    assert "C157" in guarded.log[0]
    assert 50.0 < guarded.contacts.records[0].peak_force < record.peak_force
    assert not guarded.play()
    assert not guarded.unlock()
    guarded.advance_to(2.4 + UNLOCK_AFTER)
    assert guarded.unlock()
    assert not guarded.protective


def test_a_joint_too_far_from_its_target_is_a_protective_stop():
    contact = {
        "link": "forearm",
        "point": [-0.1747, 0.0373, 0.0095],
        "normal": [-0.0008, 0.9931, 0.1174],
        "push": 600.0,
        "start": 0.1,
        "duration": 1.0,
    }
    live = robot(contacts=[contact], safety={"position_deviation": 0.005})
    live.advance_to(1.0)
    assert live.protective
    assert "C153" in live.log[0]


def test_a_stop_when_the_force_rises_makes_it_smaller():
    free = robot(obstacles=[WALL])
    free.advance_to(2.4)
    stopped = robot(obstacles=[WALL])
    t = 0.0
    while np.linalg.norm(stopped.at(t).external[:3]) < 15.0:
        t += 0.002
    stopped.run(parse("def s():\n stopj(20)\nend"))
    stopped.advance_to(2.4)
    without, reacted = free.contacts.records[0], stopped.contacts.records[0]
    assert reacted.start == without.start
    assert reacted.peak_force < 0.7 * without.peak_force
    assert reacted.stopping_distance < 0.7 * without.stopping_distance


def test_contact_points_off_the_surface_and_obstacles_in_the_arm_are_refused():
    contact = {
        "link": "forearm",
        "point": [-0.1747, 0.0503, 0.0095],
        "normal": [0.0, 1.0, 0.0],
        "push": 20.0,
        "start": 0.1,
        "duration": 1.0,
    }
    complaint = r"contacts\[0\].point: expected a point on the surface of forearm, .* 1[23].\d mm outside"
    with pytest.raises(ScriptError, match=complaint):
        robot(contacts=[contact])
    with pytest.raises(ScriptError, match=complaint):
        simulate(Script.model_validate(FIELDS | {"contacts": [contact]}))
    floor = {"kind": "half_space", "point": [0.0, 0.0, 0.3], "normal": [0.0, 0.0, 1.0]}
    with pytest.raises(ScriptError, match=r"obstacles\[0\]: expected to be clear .* deep in the half_space"):
        robot(obstacles=[floor])


def test_a_normal_that_points_into_the_link_is_refused():
    """A push along it would be a pull, which no estimate explains."""
    contact = {
        "link": "forearm", "point": [-0.1747, 0.0373, 0.0095], "start": 0.1, "duration": 1.0,
    }  # fmt: skip
    robot(contacts=[contact | {"normal": [0.0, 0.3, 1.0], "push": 20.0}])  # as at an edge
    robot(contacts=[contact | {"force_link": [0.0, 20.0, 0.0]}])  # a pull that is meant
    with pytest.raises(ScriptError, match=r"contacts\[0\]\.normal: expected the outward normal .* inward"):
        robot(contacts=[contact | {"normal": [0.0, -1.0, -0.1], "push": 20.0}])
    flank = contact | {"link": "upper_arm", "point": [-0.2, 0.0, 0.0952], "normal": [0.0, 0.0, 1.0]}
    with pytest.raises(ScriptError, match=r"upper_arm, here about \[0.0, 0.0, -1.0\], got"):
        robot(contacts=[flank | {"push": 20.0}])
