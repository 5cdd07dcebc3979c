"""Files of strangers: opened within bounds of size, depth and time, and never outside of the folder meant for them."""
