"""Falls of a proof, some of which are measured, and how the page counts them."""

from xml.etree import ElementTree

import pytest

from gaitchain.figures.proof_measures import falls_section
from gaitchain.gait.qualification import Stratum
from gaitchain.proof.falls import Drop, Fall, Watched, judge_falls
from gaitchain.proof.measures import IN_PROOF, Measures

FALLS = [Watched(Fall(cause, 300.0, 4.0, 0.5)) for cause in ("slip", "slip", "torque")]


def page_of(*falls):
    """What the section says of them."""
    body = ElementTree.Element("body")
    drop = Drop(50.0, 0.6, 300.0)
    falls_section(body, Measures(0.3, 100.0, (), None, falls, drop))
    return " ".join(body.itertext())


@pytest.mark.parametrize("fallen", [3, 70])
def test_walks_of_the_proof_that_held_are_counted_too(fallen):
    """Only those that fell are walked again, and of many only some."""
    found = judge_falls(IN_PROOF, FALLS, Stratum("all", 223, 36000, fallen, 0.0, 1e-3))
    assert (found.walks, found.falls, found.measured) == (223, fallen, 3)
    assert found.causes == (("slip", 2), ("torque", 1))
    said = page_of(found)
    assert f"walks of the proof: {fallen} falls in 223" in said
    assert ("3 of these falls were walked again" in said) == (fallen > 3)


def test_walks_that_were_all_watched_need_no_other_count():
    found = judge_falls("pushed", [*FALLS, Watched(None)])
    assert (found.walks, found.falls, found.measured) == (4, 3, 3)
    assert "pushed: 3 falls in 4" in page_of(found)
