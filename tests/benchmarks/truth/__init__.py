"""Independent ground truth: its laws, its places, its files. MuJoCo comes with the extra `truth`."""

import pytest

pytest.importorskip("mujoco", reason="the packages of contactsense[truth] are not installed")
