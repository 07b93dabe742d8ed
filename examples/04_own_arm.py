"""An arm of one's own: URDF -> primitives -> scene -> contact. Run it: python examples/04_own_arm.py

Needs the packages of the extra: pip install '.[geometry]'. Here the URDF is a small arm of three
links; with yours, its visual meshes are read, and the fit takes some minutes.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from contactsense import Localizer, Scene, robots

LINK = """<link name="{name}"><inertial><origin xyz="0 0 {middle}"/><mass value="{mass}"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><origin xyz="0 0 {middle}"/><geometry><cylinder radius="{radius}" length="{length}"/></geometry>
  </visual></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="0 0 {height}"/><axis xyz="{axis}"/>
  <limit lower="-3" upper="3" velocity="2" effort="50"/></joint>"""
URDF = "".join(
    [
        '<robot name="three">',
        LINK.format(name="base", middle=0.05, mass=4.0, radius=0.08, length=0.1),
        LINK.format(name="upper", middle=0.15, mass=3.0, radius=0.05, length=0.3),
        LINK.format(name="fore", middle=0.15, mass=2.0, radius=0.04, length=0.3),
        JOINT.format(name="turn", parent="base", child="upper", height=0.1, axis="0 1 0"),
        JOINT.format(name="bend", parent="upper", child="fore", height=0.3, axis="0 1 0"),
        "</robot>",
    ]
)


def main() -> None:
    """Write the URDF, fit primitives, and locate one push."""
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "three.urdf"
        urdf.write_text(URDF, encoding="utf-8")

        # 1. Fit primitives to the visual shapes; the file beside the URDF is found by its name.
        #    In a shell: contactsense decompose three.urdf --out three.surface.yaml
        command = ["decompose", str(urdf), "--link-max", "2", "--out", str(urdf.with_suffix(".surface.yaml"))]
        subprocess.run([sys.executable, "-m", "contactsense", *command], check=True)

        # 2. The arm, as any other; in a scene file: `robot: path/to/three.urdf`.
        robot = robots.load(urdf)
        for link in robot.links:
            print(f"{link.name}: {link.inertia.mass:g} kg, primitives: {len(link.primitives)}")
        localizer = Localizer(Scene(robot=robot))

        # 3. A push of 20 N along -x on the side of the upright forearm, 0.5 m above the base.
        point, force = np.array([0.04, 0.0, 0.5]), np.array([-20.0, 0.0, 0.0])
        moment = np.cross(point, force)
        torque = -np.array([moment[1] + 0.1 * 20.0, moment[1] + 0.4 * 20.0])  # about the joints' axes
        estimate = localizer.locate(
            np.zeros(2), base_wrench=np.concatenate([force, moment]), joint_torque=torque
        )
        best = estimate.contacts[0]
        print(f"{estimate.status} on {best.link} at {np.round(best.point_base, 3)} m")


if __name__ == "__main__":
    main()
