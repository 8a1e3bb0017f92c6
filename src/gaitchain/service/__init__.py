"""`gaitchain serve`: supervised processes, API and page on one port."""
