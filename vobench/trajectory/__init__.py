"""Stamped poses: the arrays, their text form, association and alignment. Pure."""
