"""Reports: results as text, JSON and HTML."""
