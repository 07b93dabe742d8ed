"""`contactsense robots` and `contactsense decompose`, as a user calls them."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from click import ClickException
from click.testing import CliRunner, Result
from matplotlib import image

from contactsense import Scene, robots
from contactsense.robots.decomposition.decompose import Fit, Options
from contactsense.robots.decomposition.outer_skin import OutOfReachError
from contactsense.robots.decomposition.surface_error import HEADINGS, Errors, bodies_of
from contactsense.service.cli import decompose_fits
from contactsense.service.cli.decompose import _report, beyond_tolerance
from contactsense.service.cli.decompose_fits import fit_all
from contactsense.service.cli.main import cli
from contactsense.service.drawing.palette import link_colour, rgb
from tests.robots.shapes import fork, two_links, two_meshes

URDF = """
<robot name="two"><link name="base"><visual><geometry><mesh filename="base.stl"/></geometry></visual></link>
<link name="bar"><visual><geometry><mesh filename="bar.stl"/></geometry></visual></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="bar"/><origin xyz="0 0 0.14"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="1" effort="1"/></joint></robot>
"""


def call(*arguments: str) -> Result:
    return CliRunner().invoke(cli, list(arguments))


def test_robots_lists_the_library() -> None:
    listed = json.loads(call("robots", "--json").stdout)
    assert [entry["name"] for entry in listed] == list(robots.names())
    table = call("robots").stdout
    assert all(name in table for name in robots.known_names())
    assert {entry["name"]: entry["equivalent_models"] for entry in listed}["ur10e"] == ["ur12e"]


def test_robots_shows_one() -> None:
    shown = json.loads(call("robots", "ur3e", "--json").stdout)
    assert [link["name"] for link in shown["links"]] == list(robots.load("ur3e").link_names)
    assert shown["joints"][5]["position_limits"] == [None, None]
    table = call("robots", "ur10e").stdout
    assert "wrist_3_joint" in table
    assert "mass [kg]" in table
    assert all(len(line) <= 80 for line in table.splitlines())
    assert "URDF" in call("robots", "--help").stdout
    assert "10.7" in table


@pytest.mark.slow
def test_robots_draws_one(tmp_path: Path) -> None:
    picture = tmp_path / "arm.png"
    result = call("robots", "ur5e", "--picture", str(picture), "--posture", "0,-90,90,0,30,0")
    assert result.exit_code == 0, result.output
    assert picture.read_bytes().startswith(b"\x89PNG")
    drawn = image.imread(picture)[..., :3]
    title, legend = drawn[:24], drawn[-70:].reshape(-1, 3)
    assert (title.max(axis=2) < 0.2).sum() > 100
    for link in range(len(robots.load("ur5e").links)):
        colour = np.array(rgb(link_colour(link))) / 255.0
        assert (np.abs(legend - colour).max(axis=1) < 0.02).sum() > 100


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["robots", "ur7"], 1, "there are ur3, ur3e"),
        (["robots", "--picture", "x.png"], 2, "needs the NAME"),
        (["robots", "ur5e", "--posture", "0,0,0,0,0,0"], 2, "--posture needs --picture"),
        (["robots", "ur5e", "--coarse"], 2, "--coarse needs --picture"),
        (
            ["robots", "ur5e", "--picture", "x.png", "--posture", "1,2"],
            2,
            "--posture: expected 6 angles in degrees",
        ),
        (
            ["robots", "ur5e", "--picture", "x.png", "--posture", "1,b"],
            2,
            "--posture: expected 6 angles in degrees",
        ),
        (["decompose", "ur7"], 1, "unknown robot"),
        (["decompose", "none.urdf"], 1, "none.urdf: no such file"),
        (["decompose", "ur20"], 1, "no meshes known; name a folder"),
        (["decompose", "ur5e", "--tolerance", "2 miles"], 2, "with its unit, such as 2mm, got '2 miles'"),
        (["decompose", "ur5e", "--tolerance", "2"], 2, "with its unit, such as 2mm, got '2'"),
        (["decompose", "ur5e", "--picture", "arm.pdf"], 2, "expected a name that ends in .png, got arm.pdf"),
        (["robots", "ur5e", "--picture", "arm.jpg"], 2, "expected a name that ends in .png, got arm.jpg"),
        (["decompose", "ur5e", "--meshes", "nowhere"], 1, "nowhere: no such folder"),
        (["decompose", "hand.stl"], 1, "hand.stl: a mesh, not an arm; is it a tool?"),
        (["decompose", "hand.stl", "--as-tool"], 1, "hand.stl: no such mesh"),
        (["decompose", "hand.stl", "--as-tool", "--tip", "palm"], 2, "--as-tool: expected no --meshes"),
        (
            ["decompose", "ur5e", "--tip", "foo"],
            1,
            "tip: ur5e ends at wrist_3; only a URDF may end elsewhere",
        ),
        (["decompose", "ur5e", "--scale", "0.001"], 2, "--scale: expected --as-tool or --as-body"),
        (["decompose", "hand.stl", "--as-tool", "--seed", "-1"], 2, "'--seed': -1 is not in the range x>=0"),
        (["decompose", "hand.stl", "--as-tool", "--scale", "0"], 2, "'--scale': 0.0 is not in the range x>0"),
        (["decompose", "hand.stl", "--as-tool", "--scale", "nan"], 2, "'--scale': expected a finite number"),
        (["decompose", "ur5e", "--out", "no/x.yaml"], 1, "--out: no/x.yaml: there is no folder no"),
        (["decompose", "ur5e", "--picture", "no/x.png"], 1, "--picture: no/x.png: there is no folder no"),
        (["decompose", "ur5e", "--out", "."], 1, "--out: expected a file, got the folder ."),
        (["decompose", "hand.stl", "--as-tool", "--as-body"], 2, "expected one of them, got both"),
        (["decompose", "hand.stl", "--as-body", "--meshes", "."], 2, "--as-body: expected no --meshes"),
    ],
)
def test_wrong_use_is_told(arguments: list[str], status: int, message: str) -> None:
    result = call(*arguments)
    assert result.exit_code == status
    assert message in result.output


@pytest.mark.long
def test_decompose_a_urdf_and_load_what_it_made(tmp_path: Path) -> None:
    for name, mesh in two_meshes().items():
        mesh.export(tmp_path / f"{name}.stl")
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF)
    out, picture = tmp_path / "two.surface.yaml", tmp_path / "two.png"
    result = call(
        "decompose", str(urdf), "--tolerance", "1mm", "--max", "3", "--jobs", "1",
        "--out", str(out), "--picture", str(picture),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert yaml.safe_load(out.read_text())["robot"] == "two"
    robot = robots.load(urdf)
    assert 2 <= sum(len(link.primitives) for link in robot.links) <= 3
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("tip", ["", "bar"])
def test_the_joints_of_the_arm_are_named_before_the_fit(tmp_path: Path, tip: str) -> None:
    """A gripper with a single jaw looks like one more joint, and the fit takes minutes."""
    for name, mesh in two_meshes().items():
        mesh.export(tmp_path / f"{name}.stl")
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF)
    asked = ["--tip", tip] if tip else []
    result = call("decompose", str(urdf), *asked, "--measure", str(tmp_path / "none.yaml"))
    assert f"{urdf}: joints of the arm: hinge; its last link: bar" in result.stderr
    assert ("--tip names another last link" in result.stderr) == (not tip)


def test_a_mesh_that_is_too_large_is_named_before_the_fit(tmp_path: Path) -> None:
    """A scale of 2 in the URDF, as of a mesh in half millimetres."""
    trimesh.creation.cylinder(0.05, segment=[(0.0, 0.0, -0.1), (0.0, 0.0, 0.5)]).export(tmp_path / "bar.stl")
    trimesh.creation.box((0.1, 0.1, 0.2)).export(tmp_path / "base.stl")
    elbow = (
        '<link name="tip"/><joint name="elbow" type="revolute"><parent link="bar"/><child link="tip"/>'
        '<origin xyz="0 0 0.4"/><axis xyz="1 0 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/>'
        "</joint></robot>"
    )
    urdf = tmp_path / "two.urdf"

    def warned(scale: str) -> str:
        urdf.write_text(URDF.replace('"bar.stl"', f'"bar.stl" scale="{scale}"').replace("</robot>", elbow))
        return call("decompose", str(urdf), "--measure", str(tmp_path / "none.yaml")).stderr

    assert "warning" not in warned("1 1 1")
    told = "warning: bar: its mesh extends 600 mm beyond a joint, on a link whose joints are 400 mm apart"
    assert told in warned("2 2 2")


def test_links_that_cannot_be_touched_are_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fit, hidden = Fit(bodies_of([]), Errors(*[np.zeros(0)] * 3, 1.0), (), (), 0.0), OutOfReachError("covered")
    outcomes: dict[int, object] = {0: (fit,), 1: hidden}

    def run(_: object, tasks: list[tuple[object, object, int, object]], jobs: int) -> Iterator[object]:
        yield from ((task, outcomes[task[2]]) for task in tasks)

    monkeypatch.setattr(decompose_fits, "run_tasks", run)
    assert fit_all(two_links(), two_meshes(), Options(), 1) == {"base": (fit,)}
    assert "warning: bar: covered; it gets no primitives" in capsys.readouterr().err
    outcomes[0] = hidden
    with pytest.raises(ClickException, match="two_links: no part can be touched"):
        fit_all(two_links(), two_meshes(), Options(), 1)


def test_a_link_without_a_visual_shape_is_named_before_the_fit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    two_meshes()["base"].export(tmp_path / "base.stl")
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF.replace('<visual><geometry><mesh filename="bar.stl"/></geometry></visual>', ""))
    monkeypatch.setattr(decompose_fits, "run_tasks", lambda *_: iter(()))  # nothing is fitted
    assert "warning: bar: no visual shape; it gets no primitives" in call("decompose", str(urdf)).stderr


@pytest.mark.long
def test_a_link_that_cannot_be_touched_gets_no_primitives(tmp_path: Path) -> None:
    trimesh.creation.box((0.4, 0.4, 0.4)).export(tmp_path / "base.stl")
    trimesh.creation.icosphere(2, 0.02).export(tmp_path / "bar.stl")
    urdf, out = tmp_path / "two.urdf", tmp_path / "two.surface.yaml"
    urdf.write_text(URDF)
    result = call("decompose", str(urdf), "--max", "1", "--link-max", "1", "--jobs", "1", "--out", str(out))
    assert result.exit_code == 0, result.output
    assert "warning: bar: no part of the mesh can be reached by a finger" in result.stderr
    assert [bool(link.primitives) for link in robots.load(urdf).links] == [True, False]


def test_an_arm_without_visual_shapes_needs_meshes(tmp_path: Path) -> None:
    urdf = tmp_path / "two.urdf"
    urdf.write_text(URDF.replace("visual>", "collision>"))
    result = call("decompose", str(urdf))
    assert result.exit_code == 1
    assert "no link has a visual shape; --meshes names a folder of meshes" in result.output


def test_links_without_a_mesh_keep_their_deviations(tmp_path: Path) -> None:
    two_meshes()["base"].export(tmp_path / "base.stl")
    urdf, surface = tmp_path / "two.urdf", tmp_path / "other.surface.yaml"
    urdf.write_text(URDF.replace('<visual><geometry><mesh filename="bar.stl"/></geometry></visual>', ""))
    ball = [{"kind": "sphere", "center": [0, 0, 0], "radius": 0.05}]
    link = {"fine": ball, "coarse": ball, "fine_deviation": "0 10 20 30 1.50 12\n"}
    surface.write_text(yaml.safe_dump({"robot": "two", "links": {"base": link, "bar": link}}))
    result = call("decompose", str(urdf), "--measure", str(surface))
    assert result.exit_code == 0, result.output
    assert "warning: bar: no mesh; its deviations stay as they are" in result.stderr
    written = yaml.safe_load(result.stdout)["links"]
    assert written["bar"] == link
    assert written["base"]["fine_deviation"] != link["fine_deviation"]
    surface.write_text(yaml.safe_dump({"robot": "two", "links": {"arm": link}}))
    result = call("decompose", str(urdf), "--measure", str(surface))
    assert (result.exit_code, "links.arm: two has no such link" in result.stderr) == (1, True)


def test_links_beyond_the_tolerance_are_named() -> None:
    near, far, none = np.full(100, 1e-3), np.linspace(0.0, 10e-3, 101), np.zeros(0)
    errors = {
        "good": Errors(-near, near, near, 1.0),
        "recess": Errors(far, near, near, 1.0),
        "gap": Errors(near, far, near, 1.0),
        "covered": Errors(near, none, near, 1.0),
    }
    links = {name: Fit(bodies_of([]), found, (), (), 0.0).p95 for name, found in errors.items()}
    (warning,) = beyond_tolerance(links, 2e-3)
    assert "within 2 mm, got recess 9.5 mm, gap 9.5 mm;" in warning
    assert beyond_tolerance(links, 9.6e-3) == []


def test_the_table_is_whole_where_it_is_wider_than_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    near = np.full(100, 1e-3)
    _report({"a_link_with_a_name": Fit(bodies_of([]), Errors(near, near, near, 1.0), (), (), 0.0)})
    *headings, _, row, _ = capsys.readouterr().err.strip("\n").splitlines()
    for words in ("link", "primitives", *HEADINGS):
        assert all(any(word in line for line in headings) for word in words.split())
    assert row.split()[0] == "a_link_with_a_name"


@pytest.mark.slow
def test_decompose_a_body_for_a_scene(tmp_path: Path) -> None:
    two_meshes()["base"].export(tmp_path / "post.stl")
    out = tmp_path / "post.yaml"
    asked = ["--max", "2", "--no-boxes", "--as-body"]
    result = call("decompose", str(tmp_path / "post.stl"), *asked, "--jobs", "1", "--out", str(out))
    assert result.exit_code == 0, result.output
    made = next(line for line in out.read_text().splitlines() if line.startswith("# Made by: "))
    assert made.endswith(f"--seed 0 {' '.join(asked)}"), "the command that makes the file again"
    scene = tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n" + out.read_text())
    body = Scene.load(scene).bodies[0]
    assert (body.name, body.role) == ("post", "obstacle")
    assert 1 <= len(body.primitives) <= 2
    assert len(body.deviation.splitlines()) >= len(body.primitives)


@pytest.mark.long
def test_decompose_a_tool_for_a_scene(tmp_path: Path) -> None:
    mesh = two_meshes()["base"]
    mesh.apply_scale(1000.0)
    mesh.export(tmp_path / "hand.stl")
    out, picture = tmp_path / "hand.yaml", tmp_path / "hand.png"
    result = call(
        "decompose", str(tmp_path / "hand.stl"), "--as-tool", "--scale", "0.001", "--jobs", "1",
        "--out", str(out), "--picture", str(picture),
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    assert all(len(line) <= 80 for line in result.stderr.splitlines())
    assert "picture: links" in result.stderr
    scene = tmp_path / "scene.yaml"
    scene.write_text("robot: ur5e\n" + out.read_text())
    tool = Scene.load(scene).tool
    assert tool is not None
    assert 1 <= len(tool.primitives) <= 2
    assert len(tool.deviation.splitlines()) >= len(tool.primitives)
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.long
def test_decompose_a_tool_of_several_parts(tmp_path: Path) -> None:
    """One primitive for each part is better than one for the whole; a smaller limit in all is kept."""
    fork().export(tmp_path / "fork.stl")
    found = []
    for more in ((), ("--max", "2")):
        out = tmp_path / "fork.yaml"
        result = call(
            "decompose", str(tmp_path / "fork.stl"), "--as-tool", "--link-max", "1", "--jobs", "1",
            *more, "--out", str(out),
        )  # fmt: skip
        assert result.exit_code == 0, result.output
        tool = yaml.safe_load(out.read_text())["tool"]
        found.append(len(tool["primitives"]))
        assert {int(line.split()[0]) for line in tool["deviation"].splitlines()} == set(range(found[-1]))
    assert found == [3, 1]
