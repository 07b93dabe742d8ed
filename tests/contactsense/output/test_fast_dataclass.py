"""What is filled fast is what it would be otherwise."""

import pickle
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from contactsense import Estimate
from contactsense.output.fast_dataclass import mutable_twin


def test_is_frozen_and_equal_once_it_has_its_class() -> None:
    given = (1.0, "none", (), np.zeros(7), np.zeros(6), np.zeros((6, 6)))
    made = object.__new__(mutable_twin(Estimate))
    for name in Estimate.__slots__:
        setattr(made, name, getattr(Estimate(*given, reason="so"), name))
    made.__class__ = Estimate
    assert type(made) is Estimate
    for name in Estimate.__slots__:
        assert getattr(made, name) is getattr(Estimate(*given, reason="so"), name)
    assert repr(made) == repr(Estimate(*given, reason="so"))
    assert replace(made, t=2.0).t == 2.0
    assert pickle.loads(pickle.dumps(made)).reason == "so"
    with pytest.raises(FrozenInstanceError):
        made.t = 2.0  # type: ignore[misc]
