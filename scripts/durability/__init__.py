"""Whether what was computed and written survives failures, kills and a loss of power."""
