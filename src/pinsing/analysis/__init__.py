"""An arm in one call: closed forms, sweep, random starts, and whether they agree."""
