"""`gaitchain serve`: supervised parts, one port, the page."""
