"""The sweeps of the demonstration of reactions, without the wire."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from contactsense.scene import Scene
from contactsense.service.cli.main import cli
from contactsense.service.demo.processes import Stage
from contactsense.service.demo.reaction_runs import LEVEL, rules
from contactsense.service.demo.sweeps import SCRIPT, SWEEPS, Collision, without_reaction
from contactsense.service.mock.arm.cell import Cell
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.controller.contact_log import ContactRecord
from contactsense.service.mock.controller.robot_controller import RobotController
from contactsense.service.mock.urscript.parser import parse
from contactsense.service.reactions.rules import ReactionRules
from tests.service.test_commands import run

LINKS = ("forearm", "upper_arm", "wrist_1")


@pytest.mark.slow
@pytest.mark.parametrize(("sweep", "link"), list(zip(SWEEPS, LINKS, strict=True)), ids=LINKS)
def test_each_sweep_hits_with_another_link_and_a_stop_makes_it_softer(sweep, link):
    script = Script.load(SCRIPT)
    free = without_reaction(sweep)
    assert free.link == link
    assert free.peak_force > 200.0
    robot = RobotController(Cell.of_script(script), script)
    robot.advance_to(script.duration)
    robot.run(parse(sweep.program(script.trajectory.start)))
    while np.linalg.norm(robot.at(robot.now).external[:3]) < LEVEL:
        robot.advance_to(robot.now + 0.002)
    robot.advance_to(robot.now + 0.01)  # what the estimate and the way to the robot may take
    robot.run(parse("def contactsense_stop():\n  stopj(20)\nend"))
    robot.advance_to(robot.now + 1.0)
    stopped = Collision.of(robot.contacts.records, sweep.obstacle)
    assert (stopped.link, stopped.speed) == (free.link, free.speed)
    assert stopped.peak_force < 0.5 * free.peak_force
    assert stopped.stopping_distance < 0.5 * free.stopping_distance


def test_the_rules_are_rules():
    ReactionRules.model_validate(rules(Stage("ur5e"))).check(Scene(robot="ur5e"))


def test_a_collision_out_of_a_log():
    records = [
        ContactRecord("post", "forearm", 1.0, 1.5, 0.3, 80.0, 1.1, 0.004, 5.0, 0.005),
        ContactRecord("wall", "base", 1.0, 1.5, 0.3, 500.0, 1.1, 0.004, 5.0, 0.005),
        ContactRecord("post", "wrist_1", 1.2, 1.5, 0.1, 90.0, 1.3, 0.004, 5.0, 0.004),
    ]
    found = Collision.of(records, "post")
    assert found == Collision("forearm", 0.3, 90.0, 0.005, pytest.approx(0.3))
    assert Collision.of(records, "floor") is None


@pytest.mark.long
@pytest.mark.realtime
def test_the_command_compares_both() -> None:
    # On a machine that is busy elsewhere the service may come too late: what it did is told all the same.
    status, out, err = run("demo", "--react", "--json")
    assert err == ""
    told = json.loads(out)
    assert [row["without"]["link"] for row in told["collisions"]] == list(LINKS)
    better = all(
        row["with"] is not None and row["with"]["peak_force"] < row["without"]["peak_force"]
        for row in told["collisions"]
    )
    assert status == (0 if better else 1)
    assert told["collisions"][0]["with"]["link"] == "forearm"


def test_options_that_do_not_go_together() -> None:
    told = CliRunner().invoke(cli, ["demo", "--json"])
    assert (told.exit_code, told.stdout) == (2, "")
    assert "--react" in told.stderr
