"""`python -m gaitchain`, the same as the `gaitchain` command."""

from gaitchain.cli import main

main()
