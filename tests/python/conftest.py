"""Models that several tests share. The package under test is the installed one; scenes are the repository's."""

import signal
from pathlib import Path

import pytest

import fork1s

SCENES = Path(__file__).resolve().parents[2] / "scenes"

# A shell that starts the tests in the background has them ignore Ctrl-C, which several of them send.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def scenes() -> Path:
    return SCENES


@pytest.fixture(scope="session")
def arm() -> fork1s.Model:
    """Two rods of 1 m and 1 kg, elbow at a right angle, springs of 100 N·m/rad about z."""
    return fork1s.load(SCENES / "two_link_arm.xml")


@pytest.fixture(scope="session")
def gripper() -> fork1s.Model:
    return fork1s.load(SCENES / "fourbar_gripper.xml")


@pytest.fixture(scope="session")
def hand() -> fork1s.Model:
    return fork1s.load(SCENES / "hand.xml", keyframe="open")
