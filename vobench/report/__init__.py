"""Leaderboards: scores as ranked tables, for a terminal, a page or another program."""
