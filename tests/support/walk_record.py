"""A walk's record for tests of single rules."""

from gaitchain.balance.packed_state import new_row


def walk_record(gains, times, **parts):
    """Return the record of a walk; parts by name, as `state`, are 0 if not given."""
    row = new_row(gains, times)
    for name, part in parts.items():
        row[name] = part
    return row[0]
