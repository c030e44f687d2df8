"""One configuration: singular values, what is lost there and why, ways into rank loss."""
