"""Conditions that make an arm singular as sums of cosines, and proven bounds of what they do."""
