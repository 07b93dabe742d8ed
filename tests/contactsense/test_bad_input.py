"""Bad input: it is named, it spoils nothing else, and nothing of it is taken for a number."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contactsense import Localizer, Sample, SampleBlock
from tests.at_rest import weight
from tests.contactsense.held_posture import Q, push_on_forearm, pushed
from tests.contactsense.precise import PRECISE


@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench", "t"])
def test_nan_spoils_one_sample_only(precise: Localizer, field: str) -> None:
    _, wrench = push_on_forearm()
    samples = pushed(300, wrench, 3)
    clean = list(precise.run(samples))
    bad = samples[250]
    values = {name: getattr(bad, name) for name in ("t", "q", "qd", "joint_torque", "base_wrench")}
    values[field] = float("nan") if field == "t" else np.where(np.arange(6) == 2, np.nan, values[field])
    samples[250] = Sample(**values)
    estimates = list(precise.run(samples))
    assert estimates[250].status == "degraded"
    assert "not finite" in estimates[250].reason
    assert estimates[-1].status == clean[-1].status
    np.testing.assert_allclose(
        estimates[-1].contacts[0].point_base, clean[-1].contacts[0].point_base, atol=1e-4
    )


def test_a_repeated_sample_is_not_used_twice(precise: Localizer) -> None:
    _, wrench = push_on_forearm()
    samples = pushed(200, wrench, 3)
    estimates = list(precise.run([*samples, samples[-1]]))
    assert estimates[-1].status == "degraded"
    assert "same time" in estimates[-1].reason


def test_wrong_shapes_are_named(precise: Localizer) -> None:
    with pytest.raises(ValueError, match=r"joint_torque: expected shape \(6,\), got shape \(5,\)"):
        precise.step(Sample(0.0, Q, np.zeros(6), np.zeros(5)))


@pytest.mark.parametrize("time", [1, np.float32(1.0), np.array(1.0), np.int64(1)], ids=repr)
def test_a_time_of_any_numeric_type_becomes_a_float(ordinary: Localizer, time: Any) -> None:
    """So that estimates can be written as JSON."""
    torque, wrench = weight(ordinary.scene, Q)
    ordinary.reset()
    estimate = ordinary.step(Sample(time, Q, np.zeros(6), torque, wrench))
    assert type(estimate.t) is float
    assert estimate.t == 1.0


@pytest.mark.parametrize(
    ("given", "kind", "message"),
    [
        ({"t": 0.0}, TypeError, "^sample: expected a Sample, got dict$"),
        (None, TypeError, "^sample: expected a Sample, got NoneType$"),
        (Sample("x", Q, np.zeros(6)), ValueError, "^t: expected a number, got 'x'$"),  # type: ignore[arg-type]
        (Sample(None, Q, np.zeros(6)), ValueError, "^t: expected a number, got None$"),  # type: ignore[arg-type]
        (Sample("1.0", Q, np.zeros(6)), ValueError, "^t: expected a number, got '1.0'$"),  # type: ignore[arg-type]
        (Sample(True, Q, np.zeros(6)), ValueError, "^t: expected a number, got True$"),
        (Sample(np.datetime64("2026-01-01"), Q, np.zeros(6)), ValueError, "^t: expected a number, got "),  # type: ignore[arg-type]
    ],
    ids=["dict", "None", "time in words", "no time", "digits", "flag", "date"],
)
def test_what_is_no_sample_is_refused(
    ordinary: Localizer, given: Any, kind: type[Exception], message: str
) -> None:
    """Also within a stream, which goes on afterwards."""
    torque, wrench = weight(ordinary.scene, Q)
    samples = [Sample(0.002 * i, Q, np.zeros(6), torque, wrench) for i in range(60)]
    with pytest.raises(kind, match=message):
        list(ordinary.run([given]))
    assert [estimate.t for estimate in ordinary.run(samples)][-1] == samples[-1].t
    with pytest.raises(kind, match=message):
        ordinary.step(given)
    assert ordinary.step(Sample(0.12, Q, np.zeros(6), torque, wrench)).status == "none"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"base_wrench": [0.0] * 5}, r"base_wrench: expected shape \(6,\)"),
        (
            {"base_wrench": [0.0, 1.0, np.nan, 0.0, 0.0, 0.0]},
            r"base_wrench: expected finite numbers, got nan at index \[2\]",
        ),
        ({"joint_torque": [0.0] * 5}, r"joint_torque: expected shape \(6,\) in Nm, got shape \(5,\)"),
        ({"q": None, "base_wrench": [0.0] * 6}, "q: expected numbers, got None"),
        ({"joint_torque": "strong"}, "joint_torque: expected numbers, got 'strong'"),
        ({"base_wrench": np.ma.masked_all(6)}, "base_wrench: expected finite numbers, got nan at index"),
        ({"base_wrench": np.zeros(6, "m8[ns]")}, "base_wrench: expected numbers, got array"),
        ({"base_wrench": [0.0] * 6, "external": "no"}, "external: expected True or False, got 'no'"),
        ({"base_wrench": [0.0] * 6, "detect": None}, "detect: expected True or False, got None"),
        ({}, "expected at least one of the two, got none"),
        ({"base_wrench": [0.0] * 6, "wrist_wrench": [0.0] * 6}, "wrist_wrench: the scene has no such sensor"),
    ],
)
def test_bad_arguments_are_named(ordinary: Localizer, arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ordinary.locate(**{"q": np.zeros(6), **arguments})  # type: ignore[arg-type]


def test_complex_numbers_are_none(ordinary: Localizer) -> None:
    with pytest.raises(ValueError, match=r"^q: expected numbers, got array"):
        ordinary.locate(np.zeros(6) + 1j, base_wrench=np.zeros(6))
    with pytest.raises(ValueError, match=r"^q: expected numbers, got array"):
        ordinary.step(Sample(0.0, np.zeros(6) + 1j, np.zeros(6)))


@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench"])
def test_a_masked_number_is_no_value(precise: Localizer, field: str) -> None:
    """NumPy keeps a number below the mask, and converts the array to it without a word."""
    _, wrench = push_on_forearm()
    samples = pushed(100, wrench, 3)
    masked = [
        replace(s, **{field: np.ma.masked_array(getattr(s, field), [0, 0, 1, 0, 0, 0])}) for s in samples
    ]
    nan = [replace(s, **{field: np.where(np.arange(6) == 2, np.nan, getattr(s, field))}) for s in samples]
    estimates = list(precise.run(masked))
    assert estimates[-1].status == "degraded"
    assert [e.reason for e in estimates] == [e.reason for e in precise.run(nan)]
    values = {
        name: [getattr(s, name) for s in samples] for name in ("q", "qd", "joint_torque", "base_wrench")
    }
    values[field] = np.ma.array([getattr(s, field) for s in masked])
    block = SampleBlock(np.array([s.t for s in samples]), **values)
    (found,) = precise.run_blocks([block], estimates=True)
    assert (found.phase == 0).all() if field in ("q", "qd") else not found.usable[-1].all()
    if field != "qd":
        given = {name: v for name, v in values.items() if name != "qd"}
        with pytest.raises(
            ValueError, match=rf"^{field}: expected finite numbers, got nan at index \[0, 2\]"
        ):
            precise.locate_batch(**given)


def test_a_mask_without_masked_numbers_changes_nothing(precise: Localizer) -> None:
    _, wrench = push_on_forearm()
    samples = pushed(100, wrench, 3)
    masked = [replace(s, base_wrench=np.ma.masked_array(s.base_wrench)) for s in samples]
    assert [e.status for e in precise.run(masked)] == [e.status for e in precise.run(samples)]


def test_a_flag_in_words_is_refused_in_a_batch(ordinary: Localizer) -> None:
    with pytest.raises(ValueError, match=r"^external: expected True or False, got 'no'$"):
        ordinary.locate_batch(np.zeros((2, 6)), base_wrench=np.zeros((2, 6)), external="no")  # type: ignore[arg-type]


def test_batches_must_be_of_one_length(ordinary: Localizer) -> None:
    with pytest.raises(
        ValueError, match=r"base_wrench: expected shape \(4, 6\) in N, Nm, got shape \(3, 6\)"
    ):
        ordinary.locate_batch(np.zeros((4, 6)), base_wrench=np.zeros((3, 6)))
    with pytest.raises(ValueError, match=r"joint_torque: expected shape \(4, 6\) in Nm, got shape \(4, 5\)"):
        ordinary.locate_batch(np.zeros((4, 6)), joint_torque=np.zeros((4, 5)))


@pytest.mark.parametrize("shape", [(6, 1), (1, 6), (), (2, 3), (1,) * 9 + (6,), (6, 6)])
@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench"])
def test_fields_that_are_no_vectors_are_named(
    ordinary: Localizer, field: str, shape: tuple[int, ...]
) -> None:
    """Also after the start of a stream, where its readings go to the machine code first."""
    torque, wrench = weight(ordinary.scene, Q)
    fields = {"q": Q, "qd": np.zeros(6), "joint_torque": torque, "base_wrench": wrench}
    for _ in ordinary.run([Sample(0.002 * i, **fields) for i in range(60)]):
        pass
    fields[field] = np.zeros(shape)
    with pytest.raises(ValueError, match=rf"{field}: expected shape \(6,\), got shape"):
        ordinary.step(Sample(1.0, **fields))
    del fields["qd"]
    if field != "qd":
        with pytest.raises(ValueError, match=rf"{field}: expected shape \(6,\)"):
            ordinary.locate(**fields, external=False)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [np.float64(1.0), b"abc"])
@pytest.mark.parametrize("field", ["q", "qd", "joint_torque", "base_wrench"])
def test_a_field_of_the_first_sample_that_is_no_vector_is_named(
    ordinary: Localizer, field: str, value: Any
) -> None:
    torque, wrench = weight(ordinary.scene, Q)
    fields = {"q": Q, "qd": np.zeros(6), "joint_torque": torque, "base_wrench": wrench}
    ordinary.reset()
    with pytest.raises(ValueError, match=rf"{field}: expected"):
        ordinary.step(Sample(0.0, **{**fields, field: value}))


def test_an_unusable_first_sample_rules_nothing_out(precise: Localizer) -> None:
    """Whatever could be used before it, in another stream or when the kernels were loaded."""
    torque, wrench = weight(PRECISE, Q)
    list(precise.run([Sample(0.002 * i, Q, np.zeros(6), torque, wrench) for i in range(60)]))
    precise.reset()
    first = precise.step(Sample(0.0, np.full(6, np.nan), np.zeros(6), torque, wrench))
    assert first.status == "degraded"
    assert first.detectable == np.inf
