"""What touched the arm, from a recording. Run it: python examples/03_offline_file.py [RECORDING SCENE.yaml]

A recording is a CSV or Parquet file with one row per sample: `timestamp`, `actual_q_0..5`, `actual_qd_0..5`,
`joint_torque_0..5` (or the RTDE columns that the scene names) and `base_wrench_0..5`. Without arguments a
simulated recording is made first.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

from contactsense import Contact, Localizer, Scene
from contactsense.scene import SceneError
from contactsense.service.mock.arm.script import Script
from contactsense.service.mock.arm.simulated_arm import simulate
from contactsense.service.recordings import RecordingError, read
from contactsense.service.recordings.export import write_columns
from contactsense.service.recordings.problem_lines import problem_lines


def report(path: Path, scene: Scene) -> None:
    """Print each contact of a recording: when, where, how hard; and what is wrong with the recording.

    Without a usable sample, no contact does not mean that nothing touched the arm.
    """
    localizer = Localizer(scene)
    recording = read(path, scene)
    begun: dict[int, float] = {}  # number of the contact -> when it began [s]
    ended: dict[int, float] = {}  # the same -> when it ended [s]; the last time, as a contact may resume
    strongest: dict[int, Contact] = {}  # the same -> its estimate under the largest force
    # `run` starts a new stream and yields one estimate per sample, which need not be kept.
    usable, reason = 0, ""
    for estimate in localizer.run(recording.samples()):
        usable += estimate.status != "degraded"
        reason = estimate.reason or reason
        for contact in estimate.contacts[:1]:
            before = strongest.get(contact.id)
            if before is None or force(contact) > force(before):
                strongest[contact.id] = contact
        for event in estimate.events:
            if event.kind == "onset":
                begun[event.contact] = event.t
            elif event.kind == "release":
                ended[event.contact] = event.t
    for number, end in ended.items():
        best = strongest[number]
        print(
            f"{begun[number]:7.3f} to {end:7.3f} s  {best.link:10} "
            f"{force(best):5.1f} N at {np.round(best.point, 3)} m in the link's frame"
        )
    for problem in (*problem_lines(recording.problems), *localizer.refusals, localizer.doubt):
        if problem:
            print(f"check: {problem}")
    if not ended:
        print("no contact has ended" if usable else f"no sample could be used: {reason}")


def force(contact: Contact) -> float:
    """Magnitude of the contact force [N]."""
    return float(np.linalg.norm(contact.force_base))


def simulated(path: Path) -> Path:
    """Record the simulated arm of the demonstration."""
    motion = simulate(Script.demo())
    columns = {"timestamp": motion.t}
    for i in range(6):
        columns[f"actual_q_{i}"] = motion.q[:, i]
        columns[f"actual_qd_{i}"] = motion.qd[:, i]
        columns[f"joint_torque_{i}"] = motion.joint_torque[:, i]
        columns[f"base_wrench_{i}"] = motion.base_wrench[:, i]
    write_columns(path, columns)
    return path


if __name__ == "__main__":
    if len(sys.argv) == 3:
        try:
            report(Path(sys.argv[1]), Scene.load(sys.argv[2]))
        except (SceneError, RecordingError) as error:
            sys.exit(str(error))
    elif len(sys.argv) > 1:
        sys.exit("expected RECORDING SCENE.yaml, or nothing for a simulated recording")
    else:
        example = Scene(robot="ur5e")
        with tempfile.TemporaryDirectory() as folder:
            report(simulated(Path(folder) / "demo.parquet"), example)
