"""Other people's files: opened within bounds of size, depth and time, and never outside of their folder."""
