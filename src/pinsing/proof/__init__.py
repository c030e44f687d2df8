"""Certificates of completeness: made by `produce`, accepted or rejected by `checker` alone."""
