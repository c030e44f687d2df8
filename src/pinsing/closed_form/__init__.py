"""Closed forms: the complete singular set of an arm, as equations."""
