"""Estimates and residuals of every sample as a table."""

import numpy as np
import pyarrow as pa

from contactsense import BlockEstimates
from contactsense.runtime.result_rows import FORCE, LINK, POINT, POINT_BASE, PROBABILITY, TORSION
from contactsense.scene import Scene
from contactsense.service.analysis.samples.contact_history import SENSED


def sample_table(rows: np.ndarray, found: BlockEstimates, scene: Scene) -> pa.Table:
    """One row per sample: `timestamp`, `row`, `flags` (bits, see `contactsense.sensors.stream_state`),
    `energy` of the no-contact hypothesis; external base wrench and joint torques (`base_wrench_0..5`,
    `joint_torque_0..`) with their standard deviation without contact (`..._std_0..`), null while the sensor
    is silent or settling; and for the most probable explanation `contact`, `link`, `probability`, `torsion`,
    `point_0..2` (link frame), `point_base_0..2`, `force_base_0..2`, null if there is none.

    Args:
        rows: Rows of the file, shape (N,).
        found: The localizer's estimates for them.
        scene: For the links' names.
    """
    count = len(found)
    sample, first = np.unique(found.sample, return_index=True)
    explained = np.zeros(count, dtype=bool)
    explained[sample] = True
    contact = np.zeros(count, dtype=np.int64)
    contact[sample] = found.contact[first]
    best = np.zeros((count, found.rows.shape[1]))
    best[sample] = found.rows[first]
    names = np.array(scene.link_names, dtype=object)
    columns: dict[str, pa.Array] = {
        "timestamp": pa.array(found.t),
        "row": pa.array(rows),
        "flags": pa.array(found.flags),
        "energy": pa.array(found.energy),
    }
    for number, sensor in enumerate(SENSED):
        absent = ~found.usable[:, number]
        for name in (sensor, f"{sensor}_std"):
            values = getattr(found, name)
            columns |= {f"{name}_{i}": pa.array(values[:, i], mask=absent) for i in range(values.shape[1])}
    columns["contact"] = pa.array(contact, mask=~explained)
    columns["link"] = pa.array(names[best[:, LINK].astype(np.int64)], pa.string(), mask=~explained)
    columns["probability"] = pa.array(best[:, PROBABILITY], mask=~explained)
    columns["torsion"] = pa.array(best[:, TORSION], mask=~explained)
    for name, place in (("point", POINT), ("point_base", POINT_BASE), ("force_base", FORCE)):
        columns |= {f"{name}_{i}": pa.array(best[:, place][:, i], mask=~explained) for i in range(3)}
    return pa.table(columns)
