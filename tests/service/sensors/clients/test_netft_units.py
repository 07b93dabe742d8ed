"""A Net F/T sensor's readings in every unit that it may state."""

from types import SimpleNamespace

import pytest
from pynetft import ForceUnit, TorqueUnit

from contactsense.service.sensors.clients.netft_client import NetFtStream, WrenchRecord

# NIST Special Publication 811 (2008), appendix B.8.
NEWTONS = {
    ForceUnit.NEWTON: 1.0,
    ForceUnit.KILO_NEWTON: 1e3,
    ForceUnit.KILOGRAM_FORCE: 9.80665,
    ForceUnit.POUND_FORCE: 4.448222,
    ForceUnit.KILO_POUND_FORCE: 4448.222,
}
NEWTON_METRES = {
    TorqueUnit.NEWTON_METER: 1.0,
    TorqueUnit.NEWTON_MILLIMETER: 1e-3,
    TorqueUnit.KILO_NEWTON_METER: 1e3,
    TorqueUnit.KILOGRAM_FORCE_CENTIMETER: 0.0980665,
    TorqueUnit.POUND_FORCE_INCH: 0.1129848,
    TorqueUnit.POUND_FORCE_FOOT: 1.355818,
}


@pytest.mark.parametrize("force_unit", [unit for unit in ForceUnit if unit != ForceUnit.UNKNOWN])
@pytest.mark.parametrize("torque_unit", [unit for unit in TorqueUnit if unit != TorqueUnit.UNKNOWN])
def test_a_reading_is_newtons_and_newton_metres(force_unit: ForceUnit, torque_unit: TorqueUnit) -> None:
    sample = SimpleNamespace(
        force_unit=force_unit,
        torque_unit=torque_unit,
        force=(1.0, -2.0, 3.0),
        torque=(4.0, 5.0, -6.0),
        ft_sequence=7,
        received_at_ns=8,
    )
    records: list[WrenchRecord] = []
    NetFtStream._read(iter([sample] * 3), records, 2)  # type: ignore[arg-type]  # not of a client
    assert [(record.tick, record.arrival_ns) for record in records] == [(7, 8)] * 2
    n, nm = NEWTONS[force_unit], NEWTON_METRES[torque_unit]
    assert records[0].wrench == pytest.approx((n, -2.0 * n, 3.0 * n, 4.0 * nm, 5.0 * nm, -6.0 * nm), rel=1e-6)
