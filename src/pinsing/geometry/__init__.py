"""The exact chain of an arm: rational numbers and square roots, and what was moved for that."""
