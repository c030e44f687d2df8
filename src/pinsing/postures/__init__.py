"""Postures: the pieces that singular configurations cut joint space into, and ways within them."""
