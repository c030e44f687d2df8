"""Work in chunks: durable, resumable, on any executor."""
