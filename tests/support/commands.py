"""Run a verb of the command line as a user would."""

from gaitchain.cli import run


def call(capsys, *words):
    """Exit code, standard output and standard error of one command."""
    try:
        code = run([str(word) for word in words])
    except SystemExit as stop:
        code = stop.code
    captured = capsys.readouterr()
    return code, captured.out, captured.err
