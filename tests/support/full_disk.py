"""A disk that is full, as the operating system makes one for this process alone."""

from contextlib import contextmanager

import pytest


@contextmanager
def full_disk(file_bytes):
    """Let no file grow beyond so many bytes."""
    resource = pytest.importorskip("resource", reason="limits of POSIX")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
