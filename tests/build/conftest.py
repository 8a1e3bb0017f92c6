"""A robot whose shapes overlap."""

import pytest
from toy_file import toy

HULL = '<geom type="sphere" size="0.2" pos="0 0 -0.1" mass="0"/></body>'


@pytest.fixture
def hulled(tmp_path):
    """Shapes of the arms reach into each other and into the thighs, as hulls may."""
    file = tmp_path / "hulled.xml"
    thin = 'fromto="0 0 0 0 0 -0.2" size="0.02" mass="0.3"/></body>'
    text = toy()
    assert text.count(thin) == 2
    fat = thin.replace("</body>", HULL)
    file.write_text(text.replace(thin, fat), "utf-8")
    return file
