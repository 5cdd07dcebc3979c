"""Studies: many runs of scenarios, what they cost and err by, and what follows from that."""
