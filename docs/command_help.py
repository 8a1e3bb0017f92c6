"""A directive for the pages: what `gaitchain VERB --help` prints."""

import contextlib
import io
import os

from docutils import nodes
from docutils.nodes import Node
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


class CommandHelp(SphinxDirective):
    """The help of the command that is the directive's argument; of all, without."""

    optional_arguments = 1

    def run(self) -> list[Node]:
        """Return the help as a literal block."""
        text = help_of(*self.arguments)
        block = nodes.literal_block(text, text, language="text")
        return [block]


def help_of(*verb: str) -> str:
    """Return what `gaitchain VERB --help` prints, 80 columns wide, without colours."""
    from gaitchain.cli import main  # noqa: PLC0415

    os.environ.update(COLUMNS="80", NO_COLOR="1")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        main([*verb, "--help"])
    return printed.getvalue().rstrip()


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directive known to Sphinx."""
    app.add_directive("command-help", CommandHelp)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
