"""The live page is served, goes on by itself and leaves the simulation alone."""

import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest

import fork1s


@pytest.fixture
def sim(gripper):
    sim = fork1s.Simulation(gripper)
    sim.step(3)
    try:
        fork1s.show(sim).close()
    except fork1s.FileError as error:
        pytest.skip(str(error))
    return sim


def test_a_page(sim):
    before = sim.hash()
    with fork1s.show(sim, height=300) as page:
        with urllib.request.urlopen(page.address) as answer:
            assert answer.status == 200 and b"<html" in answer.read().lower()
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(page.address.partition("?")[0])
        assert page.address in page._repr_html_() and 'height="300"' in page._repr_html_()
        assert not page.closed and page.viewers == 0
        with pytest.raises(fork1s.ModelError, match=str(port := urlsplit(page.address).port)):
            fork1s.show(sim, port=port)
    assert page.closed and sim.hash() == before
    page.close()
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(page.address)


def test_a_model_from_its_start(gripper, sim):
    with fork1s.show(gripper) as page:
        assert page.address.startswith("http://127.0.0.1:")
